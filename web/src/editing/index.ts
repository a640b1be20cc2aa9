/** What the viewer loads when a cage is to be edited: the editor and its panel. */
export { CageEditor } from './editor';
export { EditPanel } from './editPanel';
export { RangeStrip } from './rangeStrip';
