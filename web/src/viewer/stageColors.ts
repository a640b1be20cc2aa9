import type { StageColors } from '../render/stage';
import { resolvedColor } from '../style/resolvedColor';

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
