// A picture of the service. An `img` cannot carry a key, so its bytes are fetched.

import { useEffect, useState } from "preact/hooks";
import { call } from "./api";

const kept = new Map<string, Promise<string>>();

function address(path: string): Promise<string> {
  let found = kept.get(path);
  if (!found) {
    found = call(path).then(async answer => URL.createObjectURL(await answer.blob()));
    found.catch(() => kept.delete(path));
    kept.set(path, found);
  }
  return found;
}

export function Picture({ path, label }: { path: string; label: string }) {
  const [source, setSource] = useState("");
  useEffect(() => {
    let gone = false;
    address(path).then(
      url => !gone && setSource(url),
      () => undefined,
    );
    return () => void (gone = true);
  }, [path]);
  return source ? <img src={source} alt={label} /> : <span class="blank" />;
}
