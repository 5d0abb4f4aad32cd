// SPDX-License-Identifier: Apache-2.0
// Bundles the page into a folder (default: dist; RIGCAL_DASHBOARD_DIST). Ends with an error where it
// is larger than 350 KB compressed.
import { build } from 'esbuild';
import { copyFileSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { dirname, extname, join, relative } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const here = dirname(fileURLToPath(import.meta.url));
const out = process.env.RIGCAL_DASHBOARD_DIST ?? join(here, 'dist');
const limitBytes = 350_000;

rmSync(out, { recursive: true, force: true });
mkdirSync(out, { recursive: true });
const result = await build({
  absWorkingDir: here, entryPoints: { page: 'src/main.tsx', pattern: 'src/pattern/pattern_page.ts' }, outdir: join(out, 'assets'), bundle: true,
  format: 'esm', splitting: true, minify: true, target: 'es2022', jsx: 'automatic', jsxImportSource: 'preact',
  entryNames: '[name]-[hash]', chunkNames: '[name]-[hash]', metafile: true, legalComments: 'linked',
  define: { 'process.env.NODE_ENV': '"production"' }, logLevel: 'warning',
});
// Absolute, as the server shows the page at /login, too.
const address = (path) => '/' + relative(out, join(here, path)).replaceAll('\\', '/');
// Each page of static/ names the script and the style of its own source.
const pages = { 'index.html': ['src/main.tsx', '%SCRIPT%', '%STYLE%'],
  'pattern.html': ['src/pattern/pattern_page.ts', '%PATTERN_SCRIPT%', '%PATTERN_STYLE%'] };
for (const [name, [source, script, style]] of Object.entries(pages)) {
  const entry = Object.entries(result.metafile.outputs).find(([, output]) => output.entryPoint === source);
  if (!entry) throw new Error(`esbuild made nothing of ${source}`);
  writeFileSync(join(out, name), readFileSync(join(here, 'static', name), 'utf8')
    .replace(script, address(entry[0])).replace(style, address(entry[1].cssBundle)));
}
for (const file of readdirSync(join(here, 'static'))) {
  if (!(file in pages)) copyFileSync(join(here, 'static', file), join(out, file));
}

let total = 0;
const sizes = [];
const compressed = new Set(['.html', '.js', '.css', '.svg', '.json', '.webmanifest']);
for (const folder of [out, join(out, 'assets')]) {
  for (const item of readdirSync(folder, { withFileTypes: true })) {
    if (!item.isFile() || !compressed.has(extname(item.name))) continue;
    const name = join(folder, item.name);
    const zipped = gzipSync(readFileSync(name), { level: 9 });
    total += zipped.length;
    sizes.push(`${relative(out, name)} ${zipped.length}`);
  }
}
console.log(`${sizes.join('\n')}\ntotal ${total} bytes compressed`);
if (total > limitBytes) {
  console.error(`build: the page has ${total} bytes compressed, more than ${limitBytes}`);
  process.exit(1);
}
