// Bundles src/ into src/bimnav/viewer/replay.js. `node build.mjs --check` only compares with what is committed.
import { createHash } from "node:crypto";
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const target = join(here, "..", "src", "bimnav", "viewer");
const sha256 = (data) => createHash("sha256").update(data).digest("hex");

const names = [...readdirSync(join(here, "src")).map((name) => `src/${name}`), "build.mjs", "package-lock.json", "package.json"].sort();
const sources = sha256(names.map((name) => `${name} ${sha256(readFileSync(join(here, name)))}\n`).join(""));

const result = await build({
  entryPoints: [join(here, "src", "main.js")],
  bundle: true,
  charset: "ascii",
  format: "iife",
  legalComments: "none",
  minify: true,
  target: "es2022",
  write: false,
});
const script = result.outputFiles[0].contents;
const style = readFileSync(join(here, "src", "style.css"));
const licence = readFileSync(join(here, "node_modules", "three", "LICENSE"));
const version = JSON.parse(readFileSync(join(here, "node_modules", "three", "package.json"))).version;
const record = JSON.stringify({ sources, script: sha256(script), style: sha256(style), three: version }, null, 2) + "\n";

const files = {
  "replay.js": script,
  "replay.css": style,
  "bundle.json": Buffer.from(record),
  "LICENSES.txt": Buffer.concat([Buffer.from(`replay.js holds three.js ${version} (https://threejs.org):\n\n`), licence]),
};
let stale = 0;
for (const [name, contents] of Object.entries(files)) {
  const path = join(target, name);
  if (process.argv.includes("--check")) {
    if (!Buffer.from(contents).equals(readFileSync(path))) {
      console.error(`${name} is not what the sources make: run npm run build in viewer/`);
      stale = 1;
    }
  } else {
    writeFileSync(path, contents);
    console.log(`${name} ${contents.length} bytes`);
  }
}
process.exit(stale);
