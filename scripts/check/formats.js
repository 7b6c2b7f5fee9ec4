// Runs Khronos' validator on every .glb and .gltf in a folder. Errors, warnings, infos and hints all fail.
const fs = require("fs");
const path = require("path");
const validator = require("gltf-validator");

const folder = process.argv[2];
const names = fs.readdirSync(folder).filter((name) => /\.(glb|gltf)$/.test(name)).sort();

async function check(name) {
  const bytes = new Uint8Array(fs.readFileSync(path.join(folder, name)));
  const report = await validator.validateBytes(bytes, { uri: name, maxIssues: 100 });
  const { numErrors, numWarnings, numInfos, numHints } = report.issues;
  console.log(`${name}: glTF validator ${validator.version()}: ${numErrors} errors, ` +
    `${numWarnings} warnings, ${numInfos} infos, ${numHints} hints`);
  for (const message of report.issues.messages) {
    console.log(`  ${message.code} ${message.pointer ?? ""}: ${message.message}`);
  }
  return numErrors + numWarnings + numInfos + numHints === 0;
}

(async () => {
  let failed = 0;
  for (const name of names) {
    if (!(await check(name))) failed += 1;
  }
  console.log(`glTF validator: ${names.length - failed} passed, ${failed} failed`);
  process.exit(failed === 0 && names.length > 0 ? 0 : 1);
})();
