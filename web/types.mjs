// Writes src/generated of the service's OpenAPI document: openapi.ts, the types of what the service takes and answers, and
// figures.ts, the rows of the figures of its reports: npm run types
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import openapiTS, { astToString } from "openapi-typescript";

const HEAD = "// Made of openapi/ventriform.json by `npm run types`. Do not edit.\n\n";

const { openapi, info, components } = JSON.parse(readFileSync("../openapi/ventriform.json", "utf8"));
// The page builds its paths from links, so it needs no types of operations.
const document = { openapi, info, paths: {}, components: { schemas: components.schemas } };
const types = await openapiTS(document, { defaultNonNullable: false, rootTypes: true, rootTypesNoSchemaPrefix: true });
const figures = Object.fromEntries(
  Object.entries(components.schemas).flatMap(([name, schema]) =>
    schema["x-figures"] ? [[name, schema["x-figures"]]] : [],
  ),
);
mkdirSync("src/generated", { recursive: true });
writeFileSync("src/generated/openapi.ts", `${HEAD}${astToString(types)}`);
const rows = JSON.stringify(figures, null, 2);
writeFileSync("src/generated/figures.ts", `${HEAD}export const FIGURES = ${rows};\n`);
