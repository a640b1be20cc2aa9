import type { Plugin } from 'vite';
import { defineConfig } from 'vitest/config';

/** Adds `cager-viewer.js`, the one script with a fixed name: other pages load it to embed the viewer. It shares its parts with the page. */
const embeddable: Plugin = {
  name: 'embeddable-viewer',
  apply: 'build',
  buildStart() {
    this.emitFile({ type: 'chunk', id: 'src/embed.ts', fileName: 'cager-viewer.js', preserveSignature: 'strict' });
  },
};

/** Paths are relative, so that the page works under any path prefix; file names carry a hash of their content, so that they can be cached for ever. */
export default defineConfig({
  base: './',
  plugins: [embeddable],
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    cssCodeSplit: true,
    modulePreload: { polyfill: false },
    chunkSizeWarningLimit: 800,
    rolldownOptions: {
      output: {
        entryFileNames: 'assets/[name]-[hash].js',
        chunkFileNames: 'assets/[name]-[hash].js',
        assetFileNames: 'assets/[name]-[hash][extname]',
      },
    },
  },
  worker: { format: 'es' },
  test: {
    environment: 'node',
    testTimeout: 20_000,
    projects: [
      { extends: true, test: { name: 'unit', include: ['src/**/*.test.ts'] } },
      // One browser that draws in software, for all files: two at once would wait for each other until they time out.
      {
        extends: true,
        test: {
          name: 'browser',
          include: ['tests/**/*.test.ts'],
          maxWorkers: 1,
          isolate: false,
          sequence: { groupOrder: 1 },
        },
      },
    ],
  },
});
