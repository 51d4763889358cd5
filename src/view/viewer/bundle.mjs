// Makes one page of the viewer's files and the libraries from npm, as a C++ file that holds it.
//   node bundle.mjs NODE_MODULES OUTPUT.cpp LICENCES.txt                          SPDX-License-Identifier: Apache-2.0
import { createRequire } from 'node:module';
import { readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';

const [modules, output, licences] = process.argv.slice(2).map((name) => path.resolve(name));
const here = import.meta.dirname ?? path.dirname(new URL(import.meta.url).pathname);
const text = (...parts) => readFileSync(path.join(...parts), 'utf8');
const esbuild = createRequire(path.join(modules, 'x.js'))('esbuild');

const libraries = Object.keys(JSON.parse(text(here, 'package.json')).dependencies);
const licence = libraries.map((name) => {
  const { version } = JSON.parse(text(modules, name, 'package.json'));
  return `${name} ${version}\n\n${text(modules, name, 'LICENSE').trim()}\n`;
}).join('\n');
writeFileSync(licences, licence);

const options = { bundle: true, minify: true, write: false, legalComments: 'none', charset: 'utf8',
  nodePaths: [modules], target: 'es2022', logLevel: 'warning' };
const bundled = (entry, more) => esbuild.buildSync({ ...options, ...more, entryPoints: [entry] }).outputFiles[0].text;
const script = bundled(path.join(here, 'main.js'), { format: 'iife' }).replaceAll('</script', '<\\/script');
// Styles keep light-dark(), which esbuild would not know in older targets.
const css = bundled(path.join(modules, 'uplot/dist/uPlot.min.css')) +
  bundled(path.join(here, 'page.css'), { target: 'esnext' });

// Functions as replacements: a text would have its dollar signs interpreted.
const page = text(here, 'page.html').replace('/*STYLE*/', () => css).replace('/*SCRIPT*/', () => script)
  .replace('<head>', () => `<head>\n<!-- lockstep view. This page contains\n\n${licence.replaceAll('--', '- -')}-->`);

// C++ compilers take literals of 64 kB at least; neighbours become one.
const pieces = page.match(/[^]{1,16000}/gu).map((piece) => `R"page(${piece})page"`);
writeFileSync(output, `// Made by bundle.mjs. SPDX-License-Identifier: Apache-2.0
#include "view/page.h"

namespace lockstep::view {

const std::string_view page_template =
${pieces.join('\n')};

}  // namespace lockstep::view
`);
