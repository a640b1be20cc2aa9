import type { Player } from './player';

/** CSS pixels below which the tools cover what matters. */
const NARROW = 680;
/** A finer picture than this costs more than it shows. */
const FINEST_PIXEL_RATIO = 2;
/** Two pictures stand side by side in a viewer that is wider than this part of its height, else one above the other. */
const WIDE = 1.1;
/** Between what floats and the border of the picture. */
const GAP = 12;

/** Fits pictures into the viewer: how large they are, and how much of them is covered by what floats above. */
export class Layout {
  private deckHeight = 0;
  private panelShare = 0;
  private beside: Player | null = null;

  constructor(private readonly host: HTMLElement & { readonly renderRoot: ParentNode }) {}

  /** Whether there is another picture than before, or what floats above takes another part of it; parameters as of {@link apply}. */
  hasChanged(beside: Player | null, panelShare: number): boolean {
    return this.measureDeck() !== this.deckHeight || panelShare !== this.panelShare || beside !== this.beside;
  }

  /**
   * @param beside the player of a second picture, as large as the first
   * @param panelShare part of a narrow picture's height that a panel takes
   */
  apply(player: Player | null, beside: Player | null, panelShare: number) {
    const { clientWidth, clientHeight } = this.host;
    if (clientWidth === 0 || clientHeight === 0) return;
    const ratio = Math.min(FINEST_PIXEL_RATIO, devicePixelRatio);
    this.deckHeight = this.measureDeck();
    this.panelShare = panelShare;
    this.beside = beside;
    // In a wide picture tools and title stand beside the model anyway, but not in half of one.
    const isNarrow = clientWidth < NARROW;
    const [tools, lead] = ['.tools', '.lead'].map((part) => this.host.renderRoot.querySelector(part));
    const top = isNarrow ? (lead?.clientHeight ?? 0) + GAP : 0;
    const bottom = this.deckHeight + (isNarrow ? Math.round(panelShare * clientHeight) : 0);
    this.host.style.setProperty('--covered-height', `${bottom}px`);
    const isWide = clientWidth > WIDE * clientHeight;
    const right = isNarrow || (beside !== null && isWide) ? (tools?.clientWidth ?? 0) + GAP : 0;
    this.host.setAttribute('pictures', beside === null ? 'one' : isWide ? 'columns' : 'rows');
    if (beside === null) player?.resize(clientWidth, clientHeight, ratio, { top, right, bottom });
    else {
      const width = isWide ? Math.floor(clientWidth / 2) : clientWidth;
      const height = isWide ? clientHeight : Math.floor((clientHeight - bottom) / 2);
      const covered = { top, right, bottom: isWide ? bottom : 0 };
      for (const each of [player, beside]) each?.resize(width, height, ratio, covered);
    }
  }

  private measureDeck(): number {
    const deck = this.host.renderRoot.querySelector('.deck');
    const height = deck ? Math.round(this.host.getBoundingClientRect().bottom - deck.getBoundingClientRect().top) : 0;
    this.host.style.setProperty('--deck-height', `${height}px`);
    return height;
  }
}
