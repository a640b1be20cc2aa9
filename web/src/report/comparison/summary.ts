import { html, nothing } from 'lit';
import { count } from '../../text';
import type { Choice, Comparison, Claim } from '../data';
import { percents, quoted } from '../text';
import { table, type Column } from '../table';
import type { ComparisonReport, SystemReport } from './system';

export function summary({ capture, recommendation }: Comparison) {
  const measured = capture.measured.length;
  const frames = `${count(capture.frames)} frame${capture.frames === 1 ? '' : 's'}`;
  const sampled = measured === capture.frames ? frames : `${frames} (${measured} of them, evenly spaced, are measured)`;
  const model =
    capture.triangles === 0
      ? `a cloud of ${count(capture.points)} points`
      : `${count(capture.points)} points and ${count(capture.triangles)} triangles`;
  const bound = `${(100 * (recommendation.accurate - 1)).toFixed(0)} %`;
  return html`
    <h1>Encoding methods compared</h1>
    <p class="lead">
      <b>${capture.source}</b>: ${sampled} of ${model}; cage <b>${capture.cage}</b> of ${count(capture.cage_vertices)}
      vertices and ${count(capture.cage_faces)} faces. Lengths are percentages of the diagonal of the rest pose's
      bounding box (${capture.diagonal.toFixed(4)} in the capture's unit).
    </p>
    <div class="cards">
      ${
        recommendation.editing &&
        card(
          capture,
          'Best for editing',
          recommendation.editing,
          `The smoothest cages among the methods whose mean L2 is at most ${bound} above the lowest of the same coordinates: mean L2 ${percents(recommendation.editing.l2_mean, 3)} %, and ${smoothness(recommendation.editing)}.`,
        )
      }
      ${
        recommendation.accuracy &&
        card(
          capture,
          'Lowest error',
          recommendation.accuracy,
          `The lowest mean L2 of all methods here: ${percents(recommendation.accuracy.l2_mean, 3)} %; ${smoothness(recommendation.accuracy)}.`,
        )
      }
    </div>
    ${
      capture.motion_mean === null
        ? nothing
        : html`<p>
            The model's own points have a mean second difference of ${percents(capture.motion_mean, 4)} %: cages far
            above it shake where the model does not.
          </p>`
    }
  `;
}

function smoothness({ smoothness, smoothness_of }: Choice): string {
  const value = percents(smoothness, 4);
  return smoothness_of === 'second-difference'
    ? `a cage vertex's mean second difference in time is ${value} %`
    : `a cage edge's length changes by ${value} % of the mean length of the rest cage's edges on average (no three frames that follow each other were measured, so nothing is known of time)`;
}

function card(capture: Comparison['capture'], title: string, choice: Choice, why: string) {
  const command = [
    `cager encode --rest ${quoted(capture.rest)}`,
    `--cage ${quoted(capture.cage)}${capture.flip_cage ? ' --flip-cage' : ''}`,
    `--frames ${quoted(capture.source)}`,
    choice.flags,
    '-o out.cager',
  ].join(' \\\n  ');
  const copy = (event: Event) => {
    const button = event.currentTarget as HTMLButtonElement;
    const say = (text: string) => (button.textContent = text);
    navigator.clipboard.writeText(command).then(
      () => say('Copied'),
      () => say('Select the text to copy it'),
    );
  };
  return html`<article class="card">
    <h3 class="fine">${title}</h3>
    <p class="choice">${choice.system}: ${choice.method}</p>
    <p>${why}</p>
    <pre tabindex="0"><code>${command}</code></pre>
    <button @click=${copy}>Copy command</button>
  </article>`;
}

export function refused({ systems }: Comparison) {
  return systems
    .filter((system) => system.refused !== null)
    .map(({ name, refused }) => html`<p class="refused"><b>${name}</b>: ${refused}.</p>`);
}

const VERDICTS: Readonly<Record<Claim['verdict'], string>> = {
  holds: 'holds',
  'in-part': 'in part',
  fails: 'does not hold',
};

/** The paper's claims: what became of each with every system, and what was measured with the chosen one. */
export function claims({ figures, systems }: ComparisonReport, chosen: SystemReport) {
  const first = figures.claims.filter((claim, k, all) => all.findIndex((c) => c.statement === claim.statement) === k);
  const found = ({ statement }: Claim, system: string) =>
    figures.claims.find((claim) => claim.statement === statement && claim.system === system);
  const verdict = (claim: Claim | undefined) =>
    claim ? html`<span class="verdict ${claim.verdict}">${VERDICTS[claim.verdict]}</span>` : '–';
  const sentence = (text: string) => html`<span class="sentence">${text}</span>`;
  return html`
    ${table(
      first,
      [
        ...systems.map(({ name }): Column<Claim> => [name, (claim) => verdict(found(claim, name))]),
        ['claim', ({ statement }) => sentence(statement)],
        ['where', ({ source }) => source],
        [`measured with ${chosen.name}`, (claim) => sentence(found(claim, chosen.name)?.measured ?? '–')],
      ],
      3 + systems.length,
    )}
    <p class="caption">
      Verdicts are computed: differences below 2 % do not count, and a claim with two halves of which one holds does so
      in part. The paper's own figures are of cages made by artists; what an automatic cage changes is in
      <code>docs/PAPER.md</code> of the project.
    </p>
  `;
}
