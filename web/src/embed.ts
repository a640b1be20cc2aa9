/** What other pages load to show captures: it defines the element `<cager-viewer>`. */
export { CagerViewer } from './viewer/cagerViewer';
