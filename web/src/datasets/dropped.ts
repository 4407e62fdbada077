/** The files of a drop, those in dropped folders included. */

/** Most files of a drop; the service takes fewer. */
const MAX_FILES = 20_000;

/** Has to be called in the drop's own event: the browser forgets its items after that. */
export function droppedFiles(transfer: DataTransfer): Promise<File[]> {
  const entries = [...transfer.items].map((item) => (item.kind === "file" ? item.webkitGetAsEntry() : null));
  const plain = [...transfer.files];
  if (!entries.some((entry) => entry?.isDirectory)) return Promise.resolve(plain);
  return collect(entries.filter((entry) => entry !== null));
}

async function collect(entries: FileSystemEntry[]): Promise<File[]> {
  const files: File[] = [];
  const left = [...entries];
  for (let entry = left.shift(); entry; entry = left.shift()) {
    if (files.length + left.length > MAX_FILES) throw new Error(`The folder has more than ${MAX_FILES} files.`);
    // Hidden files are notes of the system that packed the folder.
    if (entry.name.startsWith(".")) continue;
    if (entry.isDirectory) left.push(...(await children(entry as FileSystemDirectoryEntry)));
    else files.push(await fileOf(entry as FileSystemFileEntry));
  }
  return files;
}

const fileOf = (entry: FileSystemFileEntry): Promise<File> => new Promise((resolve, reject) => entry.file(resolve, reject));

/** A folder's entries come in batches; an empty one is the last. */
async function children(folder: FileSystemDirectoryEntry): Promise<FileSystemEntry[]> {
  const reader = folder.createReader();
  const all: FileSystemEntry[] = [];
  for (;;) {
    const batch = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (batch.length === 0) return all;
    all.push(...batch);
    if (all.length > MAX_FILES) throw new Error(`The folder has more than ${MAX_FILES} files.`);
  }
}
