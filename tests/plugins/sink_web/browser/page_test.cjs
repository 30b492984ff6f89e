// SPDX-License-Identifier: Apache-2.0
// Tests of the page in Chromium.
"use strict";
const assert = require("node:assert");
const {after, afterEach, before, test} = require("node:test");
const fs = require("node:fs");
const path = require("node:path");
const {execFileSync} = require("node:child_process");
const {source: axe} = require("axe-core");
const {Run, launch, patience_s, until} = require("./arhost.cjs");

const desktop = {width: 1280, height: 900}, phone = {width: 360, height: 740};
let browser, run;

before(async () => {
  browser = await launch();
  run = await new Run().start();
});
afterEach(() => Promise.all(browser.contexts().map(context => context.close())));
after(async () => {
  await browser.close();
  await run.stop();
});

// Opens the page; `problems` collects errors of the console, violations of the policy, and requests to other servers.
async function open(settings = {}, url = run.url) {
  const context = await browser.newContext({viewport: desktop, bypassCSP: false, ...settings});
  const page = await context.newPage(), problems = [];
  page.on("console", message => { if (message.type() === "error" || message.type() === "warning") problems.push(message.text()); });
  page.on("pageerror", error => problems.push(String(error)));
  page.on("request", request => { if (!request.url().startsWith(url) && !request.url().startsWith("data:")) problems.push("request to " + request.url()); });
  page.setDefaultTimeout(1000 * patience_s);
  await page.goto(url, {waitUntil: "commit"}); // the picture never finishes loading
  await page.waitForSelector("#picture");
  return {page, problems, close: async () => { await context.close(); assert.deepStrictEqual(problems, []); }};
}
// Whether two screenshots of the picture differ.
async function moves(page) {
  const picture = page.locator("#picture"), first = await picture.screenshot();
  return until("the picture changes", async () => !first.equals(await picture.screenshot()));
}
// page.waitForFunction would need eval, which the page's policy forbids.
const eventually = (page, condition, argument) => until(String(condition), () => page.evaluate(condition, argument));
const result = (page, text) => eventually(page, expected => document.getElementById("result").textContent.includes(expected), text);
const isState = text => document.getElementById("state").textContent === text;
const areDead = page => page.evaluate(() => [...document.querySelectorAll("main button, main select, main input")].every(each => each.disabled));
const file = name => path.join(run.folder, name);

test("the picture moves", async () => {
  const {page, close} = await open();
  await moves(page);
  await close();
});

test("the targets have their names", async () => {
  const {page, close} = await open();
  await eventually(page, () => document.getElementById("targets").textContent.includes("tag36h11-0detected"));
  await close();
});

test("the picture moves without JavaScript", async () => {
  const {page, close} = await open({javaScriptEnabled: false});
  await moves(page);
  assert.match(await page.locator("noscript").innerText(), /need JavaScript/);
  assert.ok(!await page.locator("#commands-section").isVisible());
  await close();
});

test("the page shows the status before the first request for it", async () => {
  const {page, close} = await open({viewport: phone});
  assert.match(await page.locator("#version").innerText(), /^version \d/);
  assert.match(await page.locator("#components").innerText(), /tracker_aruco 0\.1\.0[\s\S]*Sandbox: \d+ layers/);
  assert.match(await page.locator("#stages").innerText(), /latency[\s\S]*raytracer/);
  await eventually(page, () => document.querySelectorAll("#chart polyline").length >= 5);
  await close();
});

test("freeze stops the picture and continues it", async () => {
  const {page, close} = await open();
  await page.click("#command-freeze");
  await result(page, "The video is frozen.");
  assert.strictEqual((await run.status()).frozen, true);
  assert.strictEqual(await page.getAttribute("#command-freeze", "aria-pressed"), "true");
  await page.click("#command-freeze");
  await result(page, "The video goes on.");
  await moves(page);
  await close();
});

test("snapshot and record write files", async () => {
  const {page, close} = await open();
  await page.click("#command-snapshot");
  await result(page, "Saved ");
  await until("the snapshot", () => fs.existsSync(file("out/snapshot-000.png")) || fs.existsSync(file("out/snapshot-001.png")));
  await page.click("#command-record");
  await result(page, "Recording ");
  await page.waitForSelector("#command-record[aria-pressed=true]");
  await page.click("#command-record");
  await result(page, "Recorded ");
  assert.ok(fs.readdirSync(file("out")).some(name => /^take-\d+\.mkv$/.test(name)));
  await close();
});

test("a scene is loaded and the ray tracer swapped", async () => {
  const {page, close} = await open();
  await page.selectOption("#choice-scene", "other");
  await page.click("[aria-label='Load scene']");
  await result(page, "Loaded other.");
  assert.strictEqual((await run.status()).scene, "other");
  await page.selectOption("#choice-raytracer", "smooth");
  await page.click("[aria-label='Swap raytracer']");
  await result(page, "Now runs ");
  assert.strictEqual((await run.component("raytracer")).choice, "smooth");
  await close();
});

test("changed options are set with the keyboard alone", async () => {
  const {page, close} = await open();
  const value = async () => (await run.component("sink_web")).options.find(each => each.option === "quality").value;
  for (let i = 0; i < 80 && await page.evaluate(() => document.activeElement.id) !== "option-sink_web-quality"; ++i) {
    await page.keyboard.press("Tab");
    if (await page.evaluate(() => document.activeElement.matches("#options-of-sink_web:not([open]) summary")))
      await page.keyboard.press("Enter");
  }
  const outline = await page.evaluate(() => getComputedStyle(document.activeElement).outlineStyle);
  assert.notStrictEqual(outline, "none", "the focus must be visible");
  await page.keyboard.press("Control+A");
  await page.keyboard.type("55");
  await page.keyboard.press("Enter");
  await result(page, "quality = 55");
  assert.strictEqual(await value(), 55);
  await page.keyboard.press("Control+A");
  await page.keyboard.type("500"); // more than the maximum
  await page.keyboard.press("Enter");
  assert.ok(await page.locator("#option-sink_web-quality:invalid").isVisible());
  assert.strictEqual(await value(), 55);
  await close();
});

for (const [name, settings] of [["a desktop", {}], ["a phone", {viewport: phone}], ["a dark phone", {viewport: phone, colorScheme: "dark"}]])
  test("axe finds no violation on " + name, async () => {
    const {page, close} = await open(settings);
    await page.waitForSelector("#options:not(:empty)");
    await page.evaluate(() => document.querySelectorAll("#options details").forEach(each => { each.open = true; }));
    const {violations} = await page.evaluate(axe + "; axe.run()");
    assert.deepStrictEqual(violations.map(each => each.id + ": " + each.nodes.map(node => node.html.slice(0, 120)).join(" | ")), []);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth), "the page scrolls sideways");
    await close();
  });

test("the outage of a worker is shown, and its end", async () => {
  const {page, close} = await open();
  await eventually(page, isState, "running");
  const before = (await run.component("tracker")).restarts;
  await page.evaluate(() => {
    window.states = [];
    new MutationObserver(() => window.states.push(document.getElementById("state").textContent))
        .observe(document.getElementById("state"), {childList: true, characterData: true, subtree: true});
  });
  process.kill(run.worker("tracker_aruco"), "SIGKILL");
  await eventually(page, () => window.states.some(each => /^tracker (is|has) /.test(each)));
  await eventually(page, isState, "running");
  assert.ok((await run.component("tracker")).restarts > before);
  assert.match(await page.locator("#component-tracker").innerText(), /[1-9]\d* restart/);
  await page.waitForSelector("#chart text.event");
  await moves(page);
  await close();
});

test("ten viewers get moving pictures", async () => {
  const viewers = [];
  while (viewers.length < 10) // one by one: ten starts of a page at once occupy a small machine for long
    viewers.push(await open({viewport: {width: 400, height: 400}}));
  await until("ten streams", async () => /arhost_web_viewers 10\n/.test(await (await fetch(run.url + "metrics")).text()));
  await Promise.all(viewers.map(viewer => moves(viewer.page)));
  await Promise.all(viewers.map(viewer => viewer.close()));
});

test("commands need the token, which the page asks for and remembers", async () => {
  const own = await new Run({options: "token: 0123456789abcdef"}).start();
  const {page} = await open({}, own.url);
  await page.waitForSelector("#command-freeze");
  assert.ok(await page.locator("#command-freeze").isDisabled(), "before the token is known");
  await page.fill("#token", "0123456789abcdee");
  await page.keyboard.press("Enter");
  await result(page, "This token is wrong.");
  assert.ok(await page.locator("#command-freeze").isDisabled());
  await page.fill("#token", "0123456789abcdef");
  await page.keyboard.press("Enter");
  await result(page, "The token is right.");
  assert.ok(!await page.locator("#token").isVisible());
  await page.reload({waitUntil: "commit"});
  await page.click("#command-freeze");
  await result(page, "The video is frozen.");
  await own.stop();
});

test("only granted commands have a control", async () => {
  const own = await new Run({control: "[status, snapshot]"}).start();
  const {page, close} = await open({}, own.url);
  await page.waitForSelector("#command-snapshot");
  assert.strictEqual(await page.locator("#buttons button, #choices button").count(), 1);
  assert.ok(!await page.locator("#options-section").isVisible());
  assert.ok(!await page.locator("#token").isVisible());
  await close();
  await own.stop();
});

test("quit ends the run after a confirmation", async () => {
  const own = await new Run().start();
  const {page} = await open({}, own.url);
  page.once("dialog", dialog => dialog.dismiss());
  await page.click("#command-quit");
  assert.ok((await fetch(own.url)).ok);
  page.once("dialog", dialog => dialog.accept());
  await page.click("#command-quit");
  assert.strictEqual(await own.ended, 0, own.output);
  await eventually(page, isState, "ended");
  assert.match(await page.locator("#ended").innerText(), /The run has ended[\s\S]*\d+ frames, \d+ with a target, .*no error\./);
  assert.ok(await areDead(page));
  await own.stop();
});

test("a lost connection disables the controls until it is back", async () => {
  const own = await new Run().start();
  const {page} = await open({}, own.url);
  await eventually(page, isState, "running");
  own.process.kill("SIGSTOP");
  await eventually(page, isState, "no connection");
  assert.ok(await areDead(page));
  own.process.kill("SIGCONT");
  await eventually(page, isState, "running");
  assert.ok(await page.locator("#command-freeze").isEnabled());
  await eventually(page, () => document.getElementById("picture").src.includes("/stream.mjpg"));
  await moves(page);
  own.process.kill("SIGINT");
  await eventually(page, isState, "ended");
  await own.stop();
});

test("a run that is killed is a lost connection", async () => {
  const own = await new Run().start();
  const {page} = await open({}, own.url);
  await eventually(page, isState, "running");
  own.process.kill("SIGKILL");
  await eventually(page, isState, "no connection");
  await own.stop();
});

test("a recording that fails is reported", async () => {
  const own = await new Run({record: "{plugin: sink_poses, path: out/take-%03d.jsonl}"}).start();
  const {page, close} = await open({}, own.url);
  await page.click("#command-record");
  await result(page, "Recording ");
  execFileSync("prlimit", ["--pid", own.worker("sink_poses"), "--fsize=1000"]); // like a full disk
  await result(page, "record: ");
  await eventually(page, () => document.getElementById("problems").textContent.includes("error"));
  assert.match(await page.locator("#messages").innerText(), /record: .*take-001\.jsonl.*File too large/);
  await page.waitForSelector("#command-record[aria-pressed=false]");
  const answer = await (await fetch(own.url + "api/control", {method: "POST", headers: {"Content-Type": "application/json"},
    body: JSON.stringify({command: "record", on: false})})).json();
  assert.match(answer.error, /^the recording '.*take-001\.jsonl' failed: .*File too large/);
  await close();
  await own.stop();
});

test("a wrong marker is named", async () => {
  const own = await new Run({seen: 5}).start();
  const {page, close} = await open({}, own.url);
  await eventually(page, isState, "no target");
  await eventually(page, () => document.getElementById("hint").textContent.includes("it looks for 'tag36h11-0' (tag36h11 0); it saw tag36h11 5 ("));
  assert.ok(await page.locator("#hint").isVisible());
  await close();
  await own.stop();
});

const viewers = async () => Number(/arhost_web_viewers (\d+)\n/.exec(await (await fetch(run.url + "metrics")).text())[1]);
const setHidden = (page, isHidden) => page.evaluate(value => {
  Object.defineProperty(document, "hidden", {value, configurable: true});
  document.dispatchEvent(new Event("visibilitychange"));
}, isHidden);

test("a hidden page closes its streams", async () => {
  await until("no stream", async () => await viewers() === 0);
  const {page, close} = await open();
  await until("a stream", async () => await viewers() === 1);
  await setHidden(page, true);
  await until("no stream", async () => await viewers() === 0);
  await setHidden(page, false);
  await until("a stream", async () => await viewers() === 1);
  await moves(page);
  await close();
});

test("many windows of one browser do not block each other", async () => {
  const context = await browser.newContext({viewport: desktop}), pages = [];
  while (pages.length < 7) {
    pages.push(await context.newPage());
    pages[pages.length - 1].setDefaultTimeout(1000 * patience_s);
    await pages[pages.length - 1].goto(run.url, {waitUntil: "commit"});
    await pages[pages.length - 1].waitForSelector("#command-freeze");
  }
  for (const page of [pages[0], pages[6]])
    for (const [isFrozen, text] of [[true, "The video is frozen."], [false, "The video goes on."]]) {
      await page.waitForSelector("#command-freeze[aria-pressed=" + !isFrozen + "]");
      await page.click("#command-freeze");
      await result(page, text);
    }
  await Promise.all(pages.map(page => moves(page)));
});

test("the picture stays in view while an option is changed", async () => {
  for (const viewport of [desktop, phone]) {
    const {page, close} = await open({viewport});
    await page.waitForSelector("#options-of-raytracer");
    assert.ok(!await page.locator("#option-raytracer-samples").isVisible(), "options are collapsed");
    await page.click("#options-of-raytracer summary");
    await page.locator("#option-raytracer-samples").scrollIntoViewIfNeeded();
    const picture = await page.locator("#picture").boundingBox(), field = await page.locator("#option-raytracer-samples").boundingBox();
    assert.ok(picture.y >= 0 && picture.y + picture.height <= viewport.height, JSON.stringify(picture));
    assert.ok(field.y >= 0 && field.y + field.height <= viewport.height, JSON.stringify(field));
    await close();
  }
});

test("a button at the picture shows the debug view", async () => {
  const {page, close} = await open();
  await page.click("#debug-view");
  await result(page, "The debug view is on.");
  await page.waitForSelector("#debug-view[aria-pressed=true]");
  await page.click("#debug-view");
  await result(page, "The debug view is off.");
  await close();
});

test("snapshots can be downloaded", async () => {
  const {page, close} = await open();
  await page.click("#command-snapshot");
  await result(page, "Saved ");
  const name = await page.locator("#files a").first().innerText();
  const [download] = await Promise.all([page.waitForEvent("download"), page.locator("#files a", {hasText: name}).click()]);
  assert.deepStrictEqual(fs.readFileSync(await download.path()), fs.readFileSync(file("out/" + name)));
  await close();
});
