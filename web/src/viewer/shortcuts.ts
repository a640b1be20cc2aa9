interface Shortcut {
  readonly action: string;
  /** Values of `KeyboardEvent.key`; the first one is shown. */
  readonly keys: readonly string[];
  readonly label: string;
}

/** What keys do in the viewer: the help sheet lists them, and key presses are looked up here. */
const TABLE = [
  {
    title: 'Playback',
    entries: [
      { action: 'play', keys: [' ', 'k'], label: 'Play / pause' },
      { action: 'previous', keys: ['ArrowLeft', ','], label: 'Previous frame' },
      { action: 'next', keys: ['ArrowRight', '.'], label: 'Next frame' },
      { action: 'back', keys: ['PageUp', 'j'], label: 'Back 10 frames' },
      { action: 'forth', keys: ['PageDown'], label: 'Forward 10 frames' },
      { action: 'first', keys: ['Home'], label: 'First frame' },
      { action: 'last', keys: ['End'], label: 'Last frame' },
      { action: 'slower', keys: ['<'], label: 'Slower' },
      { action: 'faster', keys: ['>'], label: 'Faster' },
      { action: 'loop', keys: ['l'], label: 'Loop, ping-pong or play once' },
      { action: 'in', keys: ['['], label: 'Set in point' },
      { action: 'out', keys: [']'], label: 'Set out point' },
      { action: 'smooth', keys: ['s'], label: 'Interpolate between frames' },
      { action: 'worst', keys: ['m'], label: 'Go to worst frame' },
    ],
  },
  {
    title: 'View',
    entries: [
      { action: 'frame', keys: ['f'], label: 'Frame all' },
      { action: 'follow', keys: ['y'], label: 'Follow the model' },
      { action: 'home', keys: ['0'], label: 'Reset view' },
      { action: 'turnLeft', keys: ['a'], label: 'Orbit left' },
      { action: 'turnRight', keys: ['d'], label: 'Orbit right' },
      { action: 'turnUp', keys: ['w'], label: 'Orbit up' },
      { action: 'turnDown', keys: ['x'], label: 'Orbit down' },
      { action: 'zoomIn', keys: ['+', '='], label: 'Zoom in' },
      { action: 'zoomOut', keys: ['-'], label: 'Zoom out' },
      { action: 'up', keys: ['z'], label: 'Up axis: Y or Z' },
      { action: 'views', keys: ['v', '8'], label: 'Views' },
      { action: 'fullscreen', keys: ['Enter'], label: 'Full screen' },
    ],
  },
  {
    title: 'Display',
    entries: [
      { action: 'model', keys: ['1'], label: 'Model' },
      { action: 'wireframe', keys: ['2'], label: 'Wireframe' },
      { action: 'points', keys: ['3'], label: 'Points' },
      { action: 'cage', keys: ['4', 'c'], label: 'Cage' },
      { action: 'handles', keys: ['5'], label: 'Handles: points that place the cage' },
      { action: 'ground', keys: ['6', 'g'], label: 'Ground' },
      { action: 'colors', keys: ['7'], label: 'Colours' },
      { action: 'materials', keys: ['*'], label: 'Materials' },
      { action: 'parts', keys: ['#'], label: 'Parts' },
      { action: 'heat', keys: ['h'], label: 'Heat map' },
      { action: 'compare', keys: ['o'], label: 'Decoded, both, ghost or original' },
      { action: 'figures', keys: ['i'], label: 'Statistics' },
      { action: 'edit', keys: ['e'], label: 'Edit cage' },
      { action: 'beside', keys: ['b'], label: 'Compare with another capture' },
      { action: 'poses', keys: ['n'], label: 'Blend poses' },
      { action: 'export', keys: ['/'], label: 'Export' },
      { action: 'picture', keys: ['p'], label: 'Save image' },
      { action: 'turntable', keys: ['t'], label: 'Record turntable' },
      { action: 'link', keys: ['9'], label: 'Copy link' },
      { action: 'help', keys: ['?'], label: 'Help' },
    ],
  },
] as const satisfies readonly { readonly title: string; readonly entries: readonly Shortcut[] }[];

export type Action = (typeof TABLE)[number]['entries'][number]['action'];
type Entry = Shortcut & { readonly action: Action };
export const SHORTCUTS: readonly { readonly title: string; readonly entries: readonly Entry[] }[] = TABLE;

const ACTIONS = new Map(
  SHORTCUTS.flatMap(({ entries }) => entries).flatMap(({ action, keys }) => keys.map((key) => [key, action] as const)),
);

/** What a key press asks for; nothing with a control, alt or command key, which belong to the browser. */
function actionOf(event: Pick<KeyboardEvent, 'key' | 'ctrlKey' | 'altKey' | 'metaKey'>): Action | null {
  if (event.ctrlKey || event.altKey || event.metaKey) return null;
  return ACTIONS.get(event.key.length === 1 ? event.key.toLowerCase() : event.key) ?? null;
}

/** What a key press asks the viewer to do; null where it belongs to a control that has the focus, or to nobody. */
export function actionOfKey(event: KeyboardEvent): Action | null {
  const target = event.composedPath()[0] as HTMLElement;
  const isControl = /^(BUTTON|A|INPUT|SELECT|LABEL)$/.test(target.tagName);
  // Space and Enter press a button that has the focus; letters choose within a list.
  if (isControl && (event.key === ' ' || event.key === 'Enter' || target.tagName === 'SELECT')) return null;
  return actionOf(event);
}

const ENTRIES = new Map(SHORTCUTS.flatMap(({ entries }) => entries.map((entry) => [entry.action, entry] as const)));

export function labelOf(action: Action): string {
  return ENTRIES.get(action)!.label;
}

const KEY_NAMES: Readonly<Record<string, string>> = {
  ' ': 'Space',
  ArrowLeft: '←',
  ArrowRight: '→',
  PageUp: 'Page ↑',
  PageDown: 'Page ↓',
};

export function keyLabel(action: Action): string {
  const [key] = ENTRIES.get(action)!.keys;
  return KEY_NAMES[key] ?? (key.length === 1 ? key.toUpperCase() : key);
}
