// What one person set for this browser: scheme, zone, name. The wall screen is in the address: "?wall=1".
import { route } from "./route.svelte";

export type Theme = "system" | "light" | "dark";
const STORE = "catseye-settings";

interface Stored { theme: Theme; zone: string; who: string }

function stored(): Stored {
  const none: Stored = { theme: "system", zone: "site", who: "" };
  try {
    const read = JSON.parse(localStorage.getItem(STORE) ?? "{}") as Partial<Stored>;
    return {
      theme: read.theme === "light" || read.theme === "dark" ? read.theme : "system",
      zone: typeof read.zone === "string" && read.zone ? read.zone : "site",
      who: typeof read.who === "string" ? read.who : "",
    };
  } catch {
    return none;
  }
}

class Settings {
  theme = $state<Theme>("system");
  /** "site", "browser", or a zone of the IANA. */
  zone = $state("site");
  /** Name that commands and acknowledgements go out under. */
  who = $state("");
  wall = $derived(route.query.wall === "1");

  constructor() {
    Object.assign(this, stored());
  }

  save(part: Partial<Stored>): void {
    Object.assign(this, part);
    const { theme, zone, who } = this;
    try {
      localStorage.setItem(STORE, JSON.stringify({ theme, zone, who }));
    } catch { /* storage is off: it lasts until the page is closed */ }
  }

  /** Put the scheme and the wall's big type on <html>; called in an effect of the shell. */
  apply(): void {
    const root = document.documentElement;
    if (this.theme === "system") delete root.dataset.theme;
    else root.dataset.theme = this.theme;
    root.classList.toggle("wall", this.wall);
  }
}

export const settings = new Settings();
