// SPDX-License-Identifier: Apache-2.0
// measure.cjs URL [SCREENSHOT_FOLDER]: prints first paint, largest paint and layout shift of the page as JSON, at the width
// of a desktop and of a phone; saves pictures of the page.
"use strict";
const {launch, sleep} = require("./arhost.cjs");

async function main([url, folder]) {
  const browser = await launch(), results = {};
  for (const [name, settings] of Object.entries({
    desktop: {viewport: {width: 1280, height: 900}},
    phone: {viewport: {width: 360, height: 740}, deviceScaleFactor: 2, isMobile: true},
    "phone-dark": {viewport: {width: 360, height: 740}, deviceScaleFactor: 2, isMobile: true, colorScheme: "dark"},
  })) {
    const page = await (await browser.newContext(settings)).newPage();
    await page.goto(url, {waitUntil: "commit"});
    await sleep(6000);
    results[name] = await page.evaluate(() => {
      const entries = type => {
        const observer = new PerformanceObserver(() => {});
        observer.observe({type, buffered: true});
        return observer.takeRecords();
      };
      return {
        first_paint_ms: entries("paint").find(each => each.name === "first-contentful-paint").startTime,
        layout_shift: entries("layout-shift").reduce((total, each) => total + each.value, 0),
      };
    });
    if (folder)
      await page.screenshot({path: folder + "/" + name + ".png", fullPage: true});
    await page.context().close();
  }
  await browser.close();
  console.log(JSON.stringify(results));
}

main(process.argv.slice(2));
