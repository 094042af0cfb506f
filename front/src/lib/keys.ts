// Keys of the whole page: "?" help, "/" search, "g" and a letter for a page. Not while someone types.

const WAIT_MS = 1500; // between "g" and its letter

export interface Keys { help: () => void; search: () => void; page: (key: string) => void }

export function listen(keys: Keys): () => void {
  let going = 0;
  const down = (event: KeyboardEvent): void => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || typing(event.target)) return;
    if (document.querySelector("dialog[open]")) return;
    if (performance.now() < going) {
      going = 0;
      keys.page(event.key.toLowerCase());
    } else if (event.key === "g") going = performance.now() + WAIT_MS;
    else if (event.key === "?") keys.help();
    else if (event.key === "/") keys.search();
    else return;
    event.preventDefault();
  };
  addEventListener("keydown", down);
  return () => removeEventListener("keydown", down);
}

function typing(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && (target.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(target.tagName));
}
