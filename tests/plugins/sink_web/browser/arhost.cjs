// SPDX-License-Identifier: Apache-2.0
// Starts arhost with sink_web, and Chromium.
"use strict";
const {spawn} = require("node:child_process");
const fs = require("node:fs");
const os = require("node:os");
const path = require("node:path");
const {chromium} = require("playwright-core");

const build = process.env.ARHOST_BUILD;
// Limits what hangs, not what is slow: other tests may occupy the machine.
const patience_s = 60;
const sleep = ms => new Promise(resolve => setTimeout(resolve, ms));

async function until(what, condition, seconds = patience_s) {
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await sleep(20)) {
    const value = await condition();
    if (value)
      return value;
  }
  throw new Error("did not happen within " + seconds + " s: " + what);
}

const commands = "[quit, freeze, snapshot, record, load_scene, swap, set, status]";
const scene = "version: 1\naxes: z-up\nmaterials: {m: {model: diffuse, diffuse: 0.5}}\n" +
    "objects: [{sphere: {centre: [0, 0, 10], radius: 10}, material: m}]\n";

class Run {
  // `options`: of sink_web, in YAML; `seen`: the marker in the picture; `record`: the output of the command.
  constructor({width = 160, height = 120, control = commands, options = "quality: 80", seen = 0,
               record = "{plugin: sink_video, path: out/take-%03d.mkv}"} = {}) {
    this.folder = fs.mkdtempSync(path.join(os.tmpdir(), "arhost-web-"));
    fs.mkdirSync(path.join(this.folder, "out"));
    for (const name of ["scene.yaml", "other.yaml"])
      fs.writeFileSync(path.join(this.folder, name), scene);
    fs.writeFileSync(path.join(this.folder, "run.yaml"), `version: 1
mode: live
source: {plugin: source_synthetic, fps: 30, options: {frames: 0, id: ${seen}, side_mm: 80, width: ${width}, height: ${height}}}
tracker: {plugin: tracker_aruco, targets: [{marker: 0, family: tag36h11, side_mm: 80}], hold_frames: 3}
raytracer: {plugin: rt_embree, scene: scene.yaml}
scenes: [other.yaml]
alternatives: {raytracer: [{name: smooth, plugin: rt_embree, options: {samples: 2}}]}
snapshot: {plugin: sink_images, path: out/snapshot-%03d.png}
record: ${record}
outputs: [{plugin: sink_web, allow: [listen], reads: [out], control: ${control}, options: {listen: "127.0.0.1:0", ${options}}}]
stats: stats.json
`);
  }
  async start() {
    this.output = "";
    this.process = spawn(path.join(build, "bin", "arhost"), ["--config", "run.yaml"],
                         {cwd: this.folder, env: {...process.env, ARHOST_PLUGIN_PATH: path.join(build, "tests", "plugins")}});
    this.ended = new Promise(resolve => this.process.on("exit", resolve));
    for (const stream of [this.process.stdout, this.process.stderr])
      stream.on("data", text => { this.output += text; });
    this.url = await until("the page's address in the output", () => {
      if (this.process.exitCode !== null)
        throw new Error(this.output);
      return (/http:\/\/127\.0\.0\.1:\d+\//.exec(this.output) || [])[0];
    });
    await until("the first frame", async () => (await fetch(this.url + "snapshot.jpg")).ok);
    return this;
  }
  async status() { return (await (await fetch(this.url + "api/status")).json()).status; }
  async component(name) { return (await this.status()).components.find(each => each.name === name); }
  // Returns the pid of a plugin's worker, which has the plugin's name.
  worker(plugin) {
    const children = pid => fs.readFileSync(`/proc/${pid}/task/${pid}/children`, "utf8").split(" ").filter(each => each).map(Number);
    for (const launcher of children(this.process.pid))
      for (const pid of children(launcher))
        if (fs.readFileSync(`/proc/${pid}/comm`, "utf8").trim() === plugin.slice(0, 15))
          return pid;
    throw new Error("no worker runs " + plugin);
  }
  async stop() {
    if (this.process && this.process.exitCode === null) {
      this.process.kill("SIGINT");
      await this.ended;
    }
    fs.rmSync(this.folder, {recursive: true, force: true});
  }
}

// Chromium cannot create its own sandbox as root and in most containers.
const launch = () => chromium.launch({executablePath: "/usr/bin/chromium", args: ["--no-sandbox", "--disable-dev-shm-usage"]});

module.exports = {Run, commands, launch, patience_s, sleep, until};
