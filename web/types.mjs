// Writes src/generated/openapi.ts, the types of what the service takes and answers, from its OpenAPI document: npm run types
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import openapiTS, { astToString } from "openapi-typescript";

const { openapi, info, components } = JSON.parse(readFileSync("../openapi/ventriform.json", "utf8"));
// The page builds its paths from links, so it needs no types of operations.
const document = { openapi, info, paths: {}, components: { schemas: components.schemas } };
const types = await openapiTS(document, { defaultNonNullable: false, rootTypes: true, rootTypesNoSchemaPrefix: true });
mkdirSync("src/generated", { recursive: true });
writeFileSync(
  "src/generated/openapi.ts",
  `// Made of openapi/ventriform.json by \`npm run types\`. Do not edit.\n\n${astToString(types)}`,
);
