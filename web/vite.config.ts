import { createHash } from 'node:crypto';
import { fileURLToPath } from 'node:url';
import type { Plugin, UserConfig } from 'vite';
import { defineConfig } from 'vitest/config';

/** Adds `cager-viewer.js`, the one script with a fixed name: other pages load it to embed the viewer. It shares its parts with the page. */
const embeddable: Plugin = {
  name: 'embeddable-viewer',
  apply: 'build',
  buildStart() {
    this.emitFile({ type: 'chunk', id: 'src/embed.ts', fileName: 'cager-viewer.js', preserveSignature: 'strict' });
  },
};

/** Parts of three.js that draw nothing here, as shaders are the page's own and there are neither lights nor headsets: by the ends of their names, and what is there instead. */
const UNUSED_PARTS: Readonly<Record<string, string>> = {
  'shaders/ShaderChunk.js': 'export const ShaderChunk = {};',
  'shaders/ShaderLib.js': 'export const ShaderLib = {};',
  'shaders/DFGLUTData.js': 'export const getDFGLUT = () => null;',
  'webgl/WebGLEnvironments.js':
    'export const WebGLEnvironments = function () { this.get = (map) => map; this.dispose = () => {}; };',
  'webgl/WebGLShadowMap.js':
    'export const WebGLShadowMap = function () { this.enabled = false; this.render = () => {}; };',
  'webgl/WebGLOutput.js': 'export const WebGLOutput = function () {};',
  'webxr/WebXRManager.js': `const nothing = () => null;
    export const WebXRManager = function () {
      Object.assign(this, { enabled: false, isPresenting: false, addEventListener: nothing, removeEventListener: nothing });
      Object.assign(this, { setAnimationLoop: nothing, getEnvironmentBlendMode: nothing, hasDepthSensing: () => false, dispose: nothing });
    };`,
};

/** Builds three.js from its sources without {@link UNUSED_PARTS}, a quarter of what would travel otherwise. */
const leanThree = (): Plugin => ({
  name: 'lean-three',
  apply: 'build',
  enforce: 'pre',
  resolveId: (id) => (id === 'three' ? fileURLToPath(import.meta.resolve('three/src/Three.js')) : null),
  load(id) {
    const part = Object.keys(UNUSED_PARTS).find((name) => id.endsWith(`/three/src/renderers/${name}`));
    return part ? { code: UNUSED_PARTS[part], moduleSideEffects: false } : null;
  },
});

/** Puts the script of a page into the page, and into its policy the script's hash: such a page is one file, which works from anywhere and asks for nothing. */
const oneFile: Plugin = {
  name: 'one-file',
  apply: 'build',
  enforce: 'post',
  generateBundle(_, bundle) {
    for (const page of Object.values(bundle)) {
      if (page.type !== 'asset' || !page.fileName.endsWith('.html')) continue;
      const source = /<script type="module"[^>]* src="\.\/([^"]+)"><\/script>/;
      const html = String(page.source);
      const name = source.exec(html)?.[1] ?? '';
      const chunk = bundle[name];
      if (!(name in bundle) || chunk.type !== 'chunk' || chunk.imports.length > 0)
        this.error(`${page.fileName} has not one script alone`);
      // What would end a script element, or begin a comment in it, only occurs in strings.
      const script = chunk.code.replaceAll(/<(?=!--|\/?script)/gi, '\\x3c').trim();
      const hash = createHash('sha256').update(script).digest('base64');
      const policy = `default-src 'none'; script-src 'sha256-${hash}'; img-src blob: data:; base-uri 'none'; form-action 'none'`;
      page.source = html
        .replace('<head>', () => `<head>\n    <meta http-equiv="Content-Security-Policy" content="${policy}" />`)
        .replace(source, () => `<script type="module">${script}</script>`);
      Reflect.deleteProperty(bundle, name);
    }
  },
};

/** The page of reports, which `cager compare`, `demo` and `cage` fill with what they found: `vite build --mode report` makes it. */
const report: UserConfig = {
  base: './',
  plugins: [leanThree(), oneFile],
  build: {
    target: 'es2022',
    outDir: 'dist/report',
    modulePreload: false,
    chunkSizeWarningLimit: 1000,
    rolldownOptions: { input: 'report.html', output: { codeSplitting: false } },
  },
};

/** Paths are relative, so that the page works under any path prefix; file names carry a hash of their content, so that they can be cached for ever. */
const page: UserConfig = {
  base: './',
  plugins: [leanThree(), embeddable],
  build: {
    target: 'es2022',
    outDir: 'dist/viewer',
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
  worker: { format: 'es', plugins: () => [leanThree()] },
};

export default defineConfig(({ mode }) => ({
  ...(mode === 'report' ? report : page),
  test: {
    environment: 'node',
    testTimeout: 60_000,
    expect: { poll: { timeout: 20_000 } },
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
          // A machine that does other things as well upsets one now and then.
          retry: 1,
          sequence: { groupOrder: 1 },
        },
      },
    ],
  },
}));
