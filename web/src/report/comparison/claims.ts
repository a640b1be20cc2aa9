import { html } from 'lit';
import type { Claim } from '../data';
import { table } from '../table';
import type { ComparisonReport, SystemReport } from './system';

const VERDICTS: Readonly<Record<Claim['verdict'], string>> = {
  holds: 'holds',
  'in-part': 'in part',
  fails: 'does not hold',
};

/** The paper's claims: what became of each with every system, and what was measured with the chosen one. */
export function claims({ figures, systems }: ComparisonReport, chosen: SystemReport) {
  const names = systems.map(({ name }) => name);
  const statements = [...new Set(figures.claims.map(({ statement }) => statement))];
  const found = (statement: string, system: string) =>
    figures.claims.find((claim) => claim.statement === statement && claim.system === system);
  const verdict = (claim: Claim | undefined) =>
    claim ? html`<span class="verdict ${claim.verdict}">${VERDICTS[claim.verdict]}</span>` : '–';
  return html`
    ${table(
      [...names, 'claim', 'where', `measured with ${chosen.name}`],
      3 + names.length,
      statements.map((statement) => {
        const [first] = figures.claims.filter((claim) => claim.statement === statement);
        return [
          ...names.map((name) => verdict(found(statement, name))),
          html`<span class="sentence">${statement}</span>`,
          first.source,
          html`<span class="sentence">${found(statement, chosen.name)?.measured ?? '–'}</span>`,
        ];
      }),
    )}
    <p class="caption">
      Verdicts are computed: differences below 2 % do not count, and a claim with two halves of which one holds does so
      in part. The paper's own figures are of cages made by artists; what an automatic cage changes is in
      <code>docs/PAPER.md</code> of the project.
    </p>
  `;
}
