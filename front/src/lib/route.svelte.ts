// Place in the address: "#/network?epoch=12&point=TR03-R". A link reopens the same view; `at` (MJD) is the replay's time.
import { token } from "./token.svelte";

function parsed(hash: string): { page: string; query: Record<string, string> } {
  const text = hash.replace(/^#\/?/, "");
  const cut = text.indexOf("?");
  const page = cut < 0 ? text : text.slice(0, cut);
  const query: Record<string, string> = {};
  if (cut >= 0) for (const [key, value] of new URLSearchParams(text.slice(cut + 1))) query[key] = value;
  return { page: page || "", query };
}

/** Address of a page; a wall screen stays one unless the query says otherwise. */
export function href(page: string, query: Record<string, string | number | null | undefined> = {}): string {
  const parts = new URLSearchParams();
  for (const [key, value] of Object.entries({ wall: route.query.wall, ...query })) if (value != null && value !== "") parts.set(key, String(value));
  const text = parts.toString();
  return `#/${page}${text ? `?${text}` : ""}`;
}

class Route {
  page = $state("");
  query = $state.raw<Record<string, string>>({});
  /** Replay's instant, or null where the page is live. */
  at = $derived.by(() => {
    const value = this.query.at === undefined ? NaN : Number(this.query.at);
    return Number.isFinite(value) ? value : null;
  });

  constructor() {
    this.read();
    if (new URLSearchParams(location.search).get("wall") === "1") { // "?wall=1" is said by people; it belongs into the route
      const parts = new URLSearchParams({ wall: "1", ...this.query });
      history.replaceState(null, "", `${location.pathname}#/${this.page}?${parts.toString()}`);
      this.read();
    }
    addEventListener("hashchange", () => this.read());
  }

  read(): void {
    token.claim();
    const { page, query } = parsed(location.hash);
    this.page = page;
    this.query = query;
  }
}

export const route = new Route();

/** Go to a page, as a step of the history; `at` of a replay stays unless the query says another. */
export function go(page: string, query: Record<string, string | number | null | undefined> = {}): void {
  location.hash = href(page, { at: route.query.at, ...query });
}

/** Change parts of this page's query in place, without a step of the history; null takes a part away. */
export function set(query: Record<string, string | number | null | undefined>): void {
  history.replaceState(null, "", href(route.page, { ...route.query, ...query }));
  route.read();
}
