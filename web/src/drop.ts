// Files and folders that a person drops on the page.

import { useEffect, useState } from "preact/hooks";

const placed = new WeakMap<File, string>();

/** The path of a file below what was chosen or dropped. */
export function pathOf(file: File): string {
  return placed.get(file) ?? (file.webkitRelativePath || file.name);
}

/** Every file of what was dropped, also inside folders. */
async function dropped(transfer: DataTransfer): Promise<File[]> {
  const entries = [...transfer.items].flatMap(item => item.webkitGetAsEntry?.() ?? []);
  if (entries.length === 0) return [...transfer.files];
  const files: File[] = [];
  const walk = async (entry: FileSystemEntry): Promise<void> => {
    if (entry.isFile) {
      const file = await new Promise<File>((done, fail) => (entry as FileSystemFileEntry).file(done, fail));
      placed.set(file, entry.fullPath.slice(1));
      files.push(file);
      return;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    for (;;) {
      const some = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
      if (some.length === 0) return;
      for (const inner of some) await walk(inner);
    }
  };
  for (const entry of entries) await walk(entry);
  return files;
}

/** Takes what is dropped anywhere on the page; the answer says whether something hangs over it. */
export function useDrop(take: (files: File[]) => void): boolean {
  const [over, setOver] = useState(false);
  useEffect(() => {
    const allow = (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes("Files")) return;
      event.preventDefault();
      setOver(true);
    };
    const leave = (event: DragEvent) => {
      if (!event.relatedTarget) setOver(false);
    };
    const release = (event: DragEvent) => {
      setOver(false);
      if (!event.dataTransfer) return;
      event.preventDefault();
      void dropped(event.dataTransfer).then(take);
    };
    addEventListener("dragover", allow);
    addEventListener("dragleave", leave);
    addEventListener("drop", release);
    return () => {
      removeEventListener("dragover", allow);
      removeEventListener("dragleave", leave);
      removeEventListener("drop", release);
    };
  }, [take]);
  return over;
}
