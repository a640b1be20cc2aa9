import { gramOf } from './gramOf';
import type { SpectrumAnswer, SpectrumRequest } from './messages';
import { spectrumOf } from './singular';

self.addEventListener('message', ({ data }: MessageEvent<SpectrumRequest>) => {
  try {
    const gram = gramOf(data, (fraction) => answer({ kind: 'progress', fraction }));
    answer({ kind: 'spectrum', spectrum: spectrumOf(gram, data.rest.length / 3) });
  } catch (error) {
    answer({ kind: 'failed', problem: error instanceof Error ? error.message : String(error) });
  }
});

function answer(message: SpectrumAnswer) {
  self.postMessage(message);
}
