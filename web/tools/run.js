// Runs a program of this folder: `node tools/run.js tools/figures.ts`. Node 20 takes no TypeScript by itself; Vite, which builds the page, does.
import process from 'node:process';
import { runnerImport } from 'vite';

await runnerImport(`./${process.argv[2]}`, { configFile: false, logLevel: 'error' });
// A browser that a failure left open must not hold the program.
process.exit();
