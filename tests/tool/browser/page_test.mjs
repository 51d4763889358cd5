// The page of `lockstep view` in headless Chromium. SPDX-License-Identifier: Apache-2.0
//   node page_test.mjs LOCKSTEP CHROMIUM MODELS
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { copyFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import path from 'node:path';
import { chromium } from 'playwright-core';

const [lockstep, executablePath, models] = process.argv.slice(2);
const arm = path.join(models, 'arm_gripper.urdf');
const scene = ['--ground', '0.9', '--drive', 'shoulder_pitch=400,20', '--drive', 'elbow=300,10', '--seconds', '1',
  '--perturb', '0.1'];

const absent = spawnSync(lockstep, ['view', arm, '--out', 'arm.html'], { encoding: 'utf8' });
if (/without the viewer/.test(absent.stderr)) {
  console.log('skipped: the command was built without the viewer');
  process.exit(0);
}
execFileSync(lockstep, ['view', arm, ...scene, '--envs', '2', '--environments', '0,1', '-o', 'arm.html']);
execFileSync(lockstep, ['simulate', arm, ...scene, '--envs', '1', '--record', 'arm.csv']);
execFileSync(lockstep, ['view', arm, '--ground', '0.9', '--record', 'arm.csv', '-o', 'replay.html']);
execFileSync(lockstep, ['view', path.join(models, 'gripper.urdf'), '--floating-base', '--seconds', '3', '-o',
  'fall.html']);
const hostile = '<!--<script>.csv';  // which would keep HTML from seeing the end of the script around it
copyFileSync('arm.csv', hostile);
execFileSync(lockstep, ['view', arm, '--record', 'arm.csv', '--record', hostile, '-o', 'hostile.html']);

let browser;
before(async () => {
  // Software rendering: the same pixels on machines with and without a graphics card.
  browser = await chromium.launch({ executablePath, args: ['--no-sandbox', '--use-angle=swiftshader',
    '--enable-unsafe-swiftshader'] });
});
after(() => browser.close());

// Opens a page once for all tests of that file and colours, at its start and at rest.
const opened = new Map();
async function page_of(file, colorScheme) {
  const key = `${file} ${colorScheme}`;
  if (!opened.has(key)) {
    const page = await browser.newPage({ viewport: { width: 760, height: 620 }, colorScheme });
    const complaints = [], asked = [];
    page.on('console', (message) => ['error', 'warning'].includes(message.type())
      // Chromium's own remark on reading pixels back, which only this test does.
      && !/GPU stall due to ReadPixels/.test(message.text()) && complaints.push(message.text()));
    page.on('pageerror', (error) => complaints.push(error.stack));
    page.on('request', (request) => /^(file|data|blob):/.test(request.url()) || asked.push(request.url()));
    await page.goto(`file://${path.resolve(file)}`);
    await page.waitForFunction(() => window.lockstep?.script_ms > 0);
    opened.set(key, { page, complaints, asked });
  }
  return opened.get(key);
}

// Fails the test for anything that the browser complains of or asks of a network.
async function with_page(file, look, colorScheme = 'light') {
  const { page, complaints, asked } = await page_of(file, colorScheme);
  await page.evaluate(() => { lockstep.play(false), lockstep.seek(0), lockstep.select(0); });
  await look(page);
  assert.deepEqual(complaints, []);
  assert.deepEqual(asked, []);
}

// Keeps the scene's pixels under a name, at a time if one is given. Read in the call that draws them: afterwards they
// are gone.
const shoot = (page, name, time) => page.evaluate(([as, at]) => {
  if (at !== undefined) lockstep.seek(at);
  lockstep.draw();
  const canvas = document.querySelector('canvas'), copy = document.createElement('canvas');
  copy.width = canvas.clientWidth, copy.height = canvas.clientHeight;
  const context = copy.getContext('2d');
  context.drawImage(canvas, 0, 0, copy.width, copy.height);
  (window.shots ??= {})[as] = context.getImageData(0, 0, copy.width, copy.height);
}, [name, time]);

// How many numbers of two shots differ clearly.
const differing = (page, one, other) => page.evaluate(([a, b]) => shots[a].data.reduce((sum, value, i) =>
  sum + (Math.abs(value - shots[b].data[i]) > 24), 0), [one, other]);

// The share of clearly blue pixels between two parts of the width, which are in [0, 1].
const blue = (page, name, from, to) => page.evaluate(([as, left, right]) => {
  const { width, height, data } = shots[as];
  let found = 0;
  for (let y = 0; y < height; ++y)
    for (let x = Math.round(left * width); x < right * width; ++x) found += data[4 * (y * width + x) + 2] >
      data[4 * (y * width + x)] + 40;
  return found / ((right - left) * width * height);
}, [name, from, to]);

test('every environment is drawn: links moved by joints are blue', () => with_page('arm.html', async (page) => {
  await shoot(page, 'start', 0);
  for (const [from, to] of [[0, 0.5], [0.5, 1]]) {
    const share = await blue(page, 'start', from, to);
    assert.ok(share > 0.01 && share < 0.6, `a share of ${share} between ${from} and ${to} of the width`);
  }
  // They start from different states, so the halves of the picture differ.
  const unlike = await page.evaluate(() => {
    const { width, height, data } = shots.start, half = width / 2;
    let found = 0;
    for (let y = 0; y < height; ++y)
      for (let x = 0, at = 4 * y * width; x < half; ++x, at += 4)
        found += Math.abs(data[at] - data[at + 4 * half]) > 24;
    return found;
  });
  assert.ok(unlike > 1000, `${unlike} pixels differ`);
}));

test('the motion moves pixels, the same time gives the same ones', () => with_page('arm.html', async (page) => {
  await shoot(page, 'start', 0);
  await shoot(page, 'later', 0.8);
  await shoot(page, 'again', 0);
  assert.ok(await differing(page, 'start', 'later') > 2000);
  assert.equal(await differing(page, 'start', 'again'), 0);
}));

test('space plays and pauses', () => with_page('arm.html', async (page) => {
  const time = () => page.evaluate(() => lockstep.time);
  assert.equal(await time(), 0);
  await page.keyboard.press(' ');
  await page.waitForFunction(() => lockstep.time > 0.05);
  assert.equal(await page.textContent('#play'), 'Pause');
  await page.keyboard.press(' ');
  const stopped = await time();
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  assert.equal(await time(), stopped);
  await page.click('#play');
  await page.waitForFunction((before) => lockstep.time !== before, stopped);
}));

test('the slider, arrow keys and clicks on curves seek', () => with_page('arm.html', async (page) => {
  const time = () => page.evaluate(() => lockstep.time);
  await page.locator('#scrub').fill('0.5');
  assert.ok(Math.abs((await time()) - 0.5) < 1e-6);
  await page.keyboard.press('ArrowRight');
  assert.ok(Math.abs((await time()) - (0.5 + 1 / 60)) < 1e-6);
  await page.keyboard.press('Shift+ArrowLeft');
  assert.ok(Math.abs((await time()) - (0.5 - 9 / 60)) < 1e-6);
  await page.keyboard.press('End');
  assert.ok(Math.abs((await time()) - 1) < 1e-6);
  const over = page.locator('.u-over').first(), box = await over.boundingBox();
  await over.click({ position: { x: 0.25 * box.width, y: 10 } });
  assert.ok(Math.abs((await time()) - 0.25) < 2 / box.width);
  await page.evaluate(() => lockstep.draw());
  const cursor = await page.locator('.now').first().boundingBox();
  assert.ok(Math.abs(cursor.x - box.x - 0.25 * box.width) < 2);
}));

test('dragging turns the view, R puts it back', () => with_page('arm.html', async (page) => {
  await shoot(page, 'before', 0);
  await page.mouse.move(250, 200);
  await page.mouse.down();
  await page.mouse.move(350, 230, { steps: 4 });
  await page.mouse.up();
  await shoot(page, 'turned');
  assert.ok(await differing(page, 'before', 'turned') > 2000);
  await page.keyboard.press('r');
  await shoot(page, 'back');
  assert.equal(await differing(page, 'before', 'back'), 0);
}));

test('curves are those of the chosen environment', () => with_page('arm.html', async (page) => {
  const titles = await page.locator('figcaption').allTextContents();
  assert.deepEqual(titles.map((title) => title.split(' ')[0]), ['joints', 'coupling', 'contact', 'energy']);
  const value = () => page.locator('figure').first().locator('.u-value').nth(1).textContent();
  await page.waitForFunction(() => document.querySelectorAll('.u-value')[1].textContent !== '--');
  const first = await value();
  await page.click('#labels button:nth-child(2)');
  await page.waitForFunction((was) =>
    !['--', was].includes(document.querySelectorAll('.u-value')[1].textContent), first);
}));

test('a recording plays, and says that it holds no contact forces', () => with_page('replay.html', async (page) => {
  assert.match(await page.textContent('#roles'), /no contact forces/);
  assert.equal(await page.locator('figure').count(), 3);
  await shoot(page, 'start', 0);
  await shoot(page, 'later', 0.8);
  assert.ok(await differing(page, 'start', 'later') > 2000);
}));

test('the view follows what falls', () => with_page('fall.html', async (page) => {
  await shoot(page, 'start', 0);
  await shoot(page, 'end', 3);  // 44 m below
  const [before, after] = [await blue(page, 'start', 0, 1), await blue(page, 'end', 0, 1)];
  assert.ok(before > 0.005 && after > 0.5 * before, `shares of ${before} and ${after}`);
}));

test('names cannot leave their place', () => with_page('hostile.html', async (page) => {
  assert.equal(await page.textContent('#labels button:nth-child(2)'), hostile);
}));

test('light and dark differ', async () => {
  const colours = [];
  for (const colorScheme of ['light', 'dark'])
    await with_page('arm.html', async (page) => {
      await shoot(page, 'start', 0);
      colours.push(await page.evaluate(() => [shots.start.data[0], getComputedStyle(document.body).color]));
    }, colorScheme);
  assert.ok(colours[0][0] > colours[1][0] + 100);
  assert.notEqual(colours[0][1], colours[1][1]);
});

// For the record: no test depends on time.
test('says what a frame costs', () => with_page('arm.html', async (page) => {
  const times = await page.evaluate(() => Array.from({ length: 60 }, (_, i) => {
    lockstep.seek(i / 60);
    const before = performance.now();
    lockstep.draw();
    return performance.now() - before;
  }).sort((a, b) => a - b));
  const [median, most] = [times[30].toFixed(1), times[57].toFixed(1)];
  console.log(`script per frame of two environments: median ${median} ms, 95 % ${most} ms`);
}));
