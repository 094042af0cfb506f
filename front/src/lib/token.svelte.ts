// The token of the service: from "#token=..." of the link that `serve` printed, or typed in settings. It lives in this
// tab's session storage, goes into headers and into the first WebSocket message, and never stands in an address.

const STORE = "catseye-token";

function fromAddress(): string | null {
  const match = /^#\/?\??token=([^&]+)/.exec(location.hash);
  if (!match?.[1]) return null;
  history.replaceState(null, "", location.pathname + location.search + "#/");
  const text = decodeURIComponent(match[1]);
  try {
    sessionStorage.setItem(STORE, text);
  } catch { /* storage is off: the token lasts until the page is closed */ }
  return text;
}

function stored(): string | null {
  try {
    return sessionStorage.getItem(STORE);
  } catch {
    return null;
  }
}

class Token {
  text = $state<string | null>(fromAddress() ?? stored());

  set(text: string | null): void {
    this.text = text?.trim() || null;
    try {
      if (this.text) sessionStorage.setItem(STORE, this.text);
      else sessionStorage.removeItem(STORE);
    } catch { /* as above */ }
  }
}

export const token = new Token();
