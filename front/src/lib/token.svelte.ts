// The token of the service: from "#token=..." of the link that `serve` printed, or typed in settings. It lives in this
// tab's session storage, goes into headers and into the first WebSocket message, and never stands in an address.

const STORE = "catseye-token";

function stored(): string | null {
  try {
    return sessionStorage.getItem(STORE);
  } catch {
    return null;
  }
}

class Token {
  text = $state<string | null>(stored());

  /** Take a token out of the address, at once: at the start, and where a link is followed in an open page. */
  claim(): void {
    const match = /^#\/?\??token=([^&]+)/.exec(location.hash);
    if (!match?.[1]) return;
    history.replaceState(null, "", `${location.pathname}${location.search}#/`);
    try {
      this.set(decodeURIComponent(match[1]));
    } catch { /* not a token: a broken escape */ }
  }

  set(text: string | null): void {
    this.text = text?.trim() || null;
    try {
      if (this.text) sessionStorage.setItem(STORE, this.text);
      else sessionStorage.removeItem(STORE);
    } catch { /* storage is off: the token lasts until the page is closed */ }
  }
}

export const token = new Token();
