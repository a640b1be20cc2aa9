import { page, tokens } from '../style/tokens';
import { sentence } from '../text';
import '../charts/chart';
import './views';
import { CageReportPage } from './cageReport';
import { ComparisonPage } from './comparisonPage';
import { readReport } from './data';
import { DemoReportPage } from './demoReport';

document.adoptedStyleSheets = [tokens.styleSheet!, page.styleSheet!];

function elementOf(): HTMLElement {
  const report = readReport(document);
  switch (report?.kind) {
    case 'comparison':
      return Object.assign(new ComparisonPage(), { report });
    case 'demo':
      return Object.assign(new DemoReportPage(), { report });
    case 'cage':
      return Object.assign(new CageReportPage(), { report });
    default:
      throw new Error('it is of an unknown kind');
  }
}

try {
  document.body.append(elementOf());
} catch (error) {
  const message = document.createElement('p');
  message.setAttribute('role', 'alert');
  const cause = sentence(error);
  message.textContent = `This report cannot be read (${cause}): the file is damaged or was changed; create it again with cager.`;
  document.body.append(message);
}
