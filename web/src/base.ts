// The path under which the service is shown: "/", or "/heart/" behind a proxy. It is where this program came from: the service
// does not always know. The service shows the files of the page under `assets/VERSION/`.

const BASE = new URL(import.meta.url).pathname.replace(/(assets\/[^/]*|src)\/[^/]*$/, "");

/** A path of the service as the browser has to ask for it. Links of the service may have the path already. */
export function at(path: string): string {
  return path.startsWith(BASE) ? path : BASE + path.replace(/^\//, "");
}
