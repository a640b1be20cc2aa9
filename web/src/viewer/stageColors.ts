import type { StageColors } from '../render/drawn';

/** Colours of the picture from the custom properties that hold for a component. */
export function stageColors(component: HTMLElement & { renderRoot: ParentNode & Node }): StageColors {
  const style = getComputedStyle(component);
  const color = (name: string) => resolvedColor(component.renderRoot, style.getPropertyValue(`--cager-${name}`));
  return {
    top: color('stage-top'),
    bottom: color('stage'),
    model: color('model'),
    wire: color('wire'),
    cage: color('cage'),
    handle: color('handle'),
    grid: color('grid'),
    shadow: Number(style.getPropertyValue('--cager-shadow-strength')) || 0,
  };
}

/** Calls back when the theme or the contrast changes, until the signal is aborted. */
export function followLooks(onChange: () => void, signal: AbortSignal) {
  for (const feature of ['(prefers-color-scheme: dark)', '(prefers-contrast: more)']) {
    matchMedia(feature).addEventListener('change', onChange, { signal });
  }
  const themes = new MutationObserver(onChange);
  themes.observe(document.documentElement, { attributeFilter: ['data-theme'] });
  signal.addEventListener('abort', () => themes.disconnect());
}

/** What the browser makes of a colour that depends on the theme, for canvases, which know no custom properties. */
export function resolvedColor(root: ParentNode & Node, color: string): string {
  const probe = document.createElement('span');
  probe.style.color = color;
  root.appendChild(probe);
  const resolved = getComputedStyle(probe).color;
  probe.remove();
  return resolved;
}
