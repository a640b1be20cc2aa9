import { html } from 'lit';
import type { Claim } from '../data';
import { table, type Column } from '../table';
import type { ComparisonReport, SystemReport } from './system';

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
