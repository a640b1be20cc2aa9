/** What the viewer loads when singular values are to be seen: the colours on the cage, and their panel. */
export { SpectrumPanel } from './spectrumPanel';
export { SpectrumView } from './spectrumView';
