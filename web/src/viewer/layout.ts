import type { Player } from './player';

/** A picture that is no wider than this in CSS pixels, and than this part of its height, has panels below the model; the styles say the same. */
const [NARROW, NARROW_ASPECT] = [680, 4 / 3];
/** A finer picture than this costs more than it shows. */
const FINEST_PIXEL_RATIO = 2;
/** Two pictures stand side by side in a viewer that is wider than this part of its height, else one above the other. */
const WIDE = 1.1;
/** The least part of a picture's width that panels leave free; where they would leave less, the larger one covers the model. */
const LEAST_FREE = 1 / 3;
/** Between what floats and the border of the picture. */
const GAP = 12;

/** Fits pictures into the viewer: how large they are, and how much of them is covered by what floats above. */
export class Layout {
  private deckHeight = 0;
  private panelShare = 0;
  private sides = { left: 0, right: 0 };
  private beside: Player | null = null;

  constructor(private readonly host: HTMLElement & { readonly renderRoot: ParentNode }) {}

  /** Whether there is another picture than before, or what floats above takes another part of it; parameters as of {@link apply}. */
  hasChanged(beside: Player | null, panelShare: number): boolean {
    const { left, right } = this.measureSides();
    return (
      this.measureDeck() !== this.deckHeight ||
      panelShare !== this.panelShare ||
      beside !== this.beside ||
      left !== this.sides.left ||
      right !== this.sides.right
    );
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
    this.sides = this.measureSides();
    this.panelShare = panelShare;
    this.beside = beside;
    const { left, right } = this.sides;
    const lead = this.host.renderRoot.querySelector('.lead');
    const isNarrow = this.isNarrow;
    const top = isNarrow ? (lead?.clientHeight ?? 0) + GAP : 0;
    const bottom = this.deckHeight + (isNarrow ? Math.round(panelShare * clientHeight) : 0);
    this.host.style.setProperty('--covered-height', `${bottom}px`);
    const isWide = clientWidth > WIDE * clientHeight;
    this.host.setAttribute('pictures', beside === null ? 'one' : isWide ? 'columns' : 'rows');
    if (beside === null || !isWide) {
      const height = beside === null ? clientHeight : Math.floor((clientHeight - bottom) / 2);
      const covered = { top, right, bottom: beside === null ? bottom : 0, left };
      for (const each of [player, beside]) each?.resize(clientWidth, height, ratio, covered);
      return;
    }
    // What panels leave free is as wide in both pictures, which have one camera; the tools cover both as they do without panels.
    const tools = this.toolsWidth;
    const first = Math.floor((clientWidth + left - Math.max(0, right - tools)) / 2);
    this.host.style.setProperty('--first-width', `${first}px`);
    player?.resize(first, clientHeight, ratio, { top, right: tools, bottom, left });
    beside.resize(clientWidth - first, clientHeight, ratio, { top, right: Math.max(tools, right), bottom, left: 0 });
  }

  private get isNarrow(): boolean {
    const { clientWidth, clientHeight } = this.host;
    return clientWidth <= NARROW && clientWidth <= NARROW_ASPECT * clientHeight;
  }

  private get toolsWidth(): number {
    return (this.host.renderRoot.querySelector('.tools')?.clientWidth ?? 0) + GAP;
  }

  /**
   * How far tools and panels reach into the picture. In a wide one the title stands beside the model anyway; in a narrow one panels lie below it.
   */
  private measureSides() {
    if (this.isNarrow) return { left: 0, right: this.toolsWidth };
    const { left, right } = this.host.getBoundingClientRect();
    const boxOf = (part: string) => this.host.renderRoot.querySelector(part)?.getBoundingClientRect();
    const editor = boxOf('cager-edit-panel, cager-pose-panel');
    const tools = boxOf('.tools');
    // What is not shown has no box.
    const inner = (boxOf('.panel') ?? (tools && tools.width > 0 ? tools : undefined))?.left;
    const sides = { left: Math.round((editor?.right ?? left) - left), right: Math.round(right - (inner ?? right)) };
    if (right - left - sides.left - sides.right < LEAST_FREE * (right - left))
      sides[sides.left > sides.right ? 'left' : 'right'] = 0;
    return sides;
  }

  private measureDeck(): number {
    const deck = this.host.renderRoot.querySelector('.deck');
    const height = deck ? Math.round(this.host.getBoundingClientRect().bottom - deck.getBoundingClientRect().top) : 0;
    this.host.style.setProperty('--deck-height', `${height}px`);
    return height;
  }
}
