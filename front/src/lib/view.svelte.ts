// The state that pages show: the live one, or the replay's at the instant in the address; never a mixture.
import { ApiError, get } from "./api";
import { live } from "./live.svelte";
import { route } from "./route.svelte";
import type { State } from "./state";

class View {
  private past = $state.raw<State | null>(null);
  refusal = $state<string | null>(null);
  state = $derived(route.at === null ? live.state : this.past);
  /** Instant of the view, MJD: of the replay, else the site's now. */
  get now(): number {
    return route.at ?? live.now();
  }

  /** Age of a value at the view's instant, s. */
  age(mjd: number): number {
    return (this.now - mjd) * 86400;
  }

  /** Read the state of the address's instant; called in an effect of the shell, the answer cancels. */
  follow(): (() => void) | undefined {
    const at = route.at;
    if (at === null) {
      this.past = null;
      this.refusal = null;
      return undefined;
    }
    const abort = new AbortController();
    const timer = setTimeout(async () => {
      try {
        this.past = await get<State>("/api/state", { at }, abort.signal);
        this.refusal = null;
      } catch (error) {
        if (abort.signal.aborted) return;
        this.past = null;
        this.refusal = error instanceof ApiError ? error.message : String(error);
      }
    }, 120); // while the slider moves
    return () => {
      clearTimeout(timer);
      abort.abort();
    };
  }
}

export const view = new View();
