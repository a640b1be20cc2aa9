import { css, html } from 'lit';
import * as glyphs from './glyphs';

/** What to do where there are no sessions yet. */
export function emptyList() {
  const server = new URL('.', document.baseURI).href.replace(/\/$/, '');
  const command = `cager encode --server ${server} --rest rest.obj --frames frames.npy -o capture.cager`;
  const copy = (event: Event): void => {
    const button = event.currentTarget as HTMLElement;
    void navigator.clipboard.writeText(command).then(() => button.setAttribute('aria-label', 'Copied'));
  };
  return html`
    <section class="first" aria-labelledby="first-title">
      <div>
        <h2 id="first-title">No sessions yet</h2>
        <p>A session turns one animated mesh into a small capture that plays here. There are three ways to see one.</p>
      </div>
      <ul class="ways">
        <li>
          <div>
            <h3>Upload from this browser</h3>
            <p>Drop a rest pose and its frames; the cage is made where you have none.</p>
          </div>
          <a class="button primary" href="#/upload">${glyphs.upload} Upload</a>
        </li>
        <li>
          <div>
            <h3>Encode from the command line</h3>
            <p>The frames go to this service, and the session shows up here.</p>
          </div>
          <span></span>
          <div class="command">
            <code>${command}</code>
            <button type="button" class="icon" aria-label="Copy the command" title="Copy the command" @click=${copy}>
              ${glyphs.copy}
            </button>
          </div>
        </li>
        <li>
          <div>
            <h3>Look at a file you have</h3>
            <p>A .cager file plays in the page; it is not sent anywhere.</p>
          </div>
          <a class="button" href="#/file">${glyphs.file} Open a file</a>
        </li>
      </ul>
    </section>
  `;
}

export const emptyListStyle = css`
  .first {
    display: grid;
    gap: var(--cager-space-5);
    max-width: 680px;
    margin: var(--cager-space-6) auto 0;
  }
  .first h2 {
    margin: 0 0 var(--cager-space-1);
    font-size: var(--cager-size-large);
  }
  .first p {
    margin: 0;
    color: var(--cager-muted);
  }
  .ways {
    display: grid;
    gap: var(--cager-space-3);
    margin: 0;
    padding: 0;
    list-style: none;
  }
  .ways li {
    display: grid;
    grid-template-columns: 1fr auto;
    gap: var(--cager-space-2) var(--cager-space-4);
    align-items: center;
    padding: var(--cager-space-4) var(--cager-space-5);
    border: 1px solid var(--cager-line);
    border-radius: var(--cager-radius-large);
    background: var(--cager-surface);
  }
  .ways h3 {
    margin: 0;
    font-size: var(--cager-size);
  }
  .command {
    grid-column: 1 / -1;
    display: flex;
    align-items: center;
    gap: var(--cager-space-2);
    min-width: 0;
  }
  code {
    flex: 1;
    min-width: 0;
    padding: var(--cager-space-2) var(--cager-space-3);
    border-radius: var(--cager-radius-small);
    background: var(--cager-raised);
    font: var(--cager-size-small) / 1.6 var(--cager-mono);
    overflow-wrap: anywhere;
  }
  @media (max-width: 860px) {
    .ways li {
      padding: var(--cager-space-4);
    }
  }
`;
