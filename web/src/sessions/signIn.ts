import { LitElement, css, html, nothing } from 'lit';
import { customElement, query, state } from 'lit/decorators.js';
import { controls } from '../style/controls';
import { tokens } from '../style/tokens';
import { pageToken } from '../service/token';

/** Asks for an access token and gives it to the page. Whoever shows it listens to `change` of `pageToken`, and hides it then. */
@customElement('cager-sign-in')
export class SignIn extends LitElement {
  static override styles = [
    tokens,
    controls,
    css`
      :host {
        display: block;
      }
      form {
        display: grid;
        gap: var(--cager-space-4);
        max-width: 440px;
        margin: var(--cager-space-7) auto;
        padding: var(--cager-space-6);
      }
      .error {
        color: var(--cager-bad);
      }
    `,
  ];

  @state() private wrong = '';
  @query('input[type=password]') private input!: HTMLInputElement;
  @query('input[type=checkbox]') private keep!: HTMLInputElement;

  override render() {
    // A token that is there although this is shown was refused.
    const refused = pageToken.token !== null ? 'The token was not accepted. Check it, or ask for a new one.' : '';
    const error = this.wrong || refused;
    return html`
      <form class="card" @submit=${this.submit}>
        <h2>Sign in</h2>
        <p class="muted">This service needs an access token. Ask your administrator for one.</p>
        <div class="field">
          <label for="token">Access token</label>
          <input
            id="token"
            type="password"
            autocomplete="current-password"
            spellcheck="false"
            autocapitalize="off"
            required
            aria-invalid=${error ? 'true' : 'false'}
            aria-describedby=${error ? 'error' : nothing}
          />
          <p class="error" id="error" role="alert" ?hidden=${!error}>${error}</p>
        </div>
        <label class="row"><input type="checkbox" checked /> Stay signed in until this tab is closed</label>
        <button class="primary" type="submit">Sign in</button>
      </form>
    `;
  }

  override firstUpdated() {
    this.input.focus();
  }

  private readonly submit = (event: SubmitEvent) => {
    event.preventDefault();
    const token = this.input.value.trim().replace(/^Bearer\s+/i, '');
    if (!/^[\x21-\x7e]+$/.test(token)) {
      this.wrong = 'A token has no spaces or special letters. Copy it again.';
      return;
    }
    this.wrong = '';
    this.input.value = '';
    pageToken.set(token, this.keep.checked);
  };
}
