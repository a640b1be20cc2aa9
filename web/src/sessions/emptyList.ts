import { html } from 'lit';
import { glyphs } from '../style/glyphs';
import walk from './walk.svg';

/** What to do where there are no sessions yet. */
export function emptyList() {
  const server = new URL('.', document.baseURI).href.replace(/\/$/, '');
  const command = `cager encode --server ${server} --rest rest.obj --frames frames.npy -o capture.cager`;
  const copy = (event: Event) => {
    const button = event.currentTarget as HTMLElement;
    void navigator.clipboard.writeText(command).then(() => button.setAttribute('aria-label', 'Copied'));
  };
  return html`
    <section class="first" aria-labelledby="first-title">
      <img src=${walk} width="1220" height="400" alt="Five frames of a walk, each inside its cage" />
      <div>
        <h2 id="first-title">No sessions yet</h2>
        <p>A session turns one animated mesh into a small capture that plays here. There are three ways to start.</p>
      </div>
      <ul class="ways">
        <li class="card">
          <div>
            <h3>Upload from this browser</h3>
            <p>Drop a rest pose and its frames; a cage is created if you have none.</p>
          </div>
          <a class="button primary" href="#/upload">${glyphs.upload} Upload</a>
        </li>
        <li class="card">
          <div>
            <h3>Encode from the command line</h3>
            <p>Frames go to this service, and the session appears here.</p>
          </div>
          <span></span>
          <div class="command row">
            <code class="grow">${command}</code>
            <button type="button" class="icon" aria-label="Copy command" title="Copy command" @click=${copy}>
              ${glyphs.copy}
            </button>
          </div>
        </li>
        <li class="card">
          <div>
            <h3>Open a file</h3>
            <p>A .cager file plays in this page and is not uploaded.</p>
          </div>
          <a class="button" href="#/file">${glyphs.file} Open file</a>
        </li>
      </ul>
    </section>
  `;
}
