// What seldom changes: the service and the site behind it. Read at the start and after each return of the link.
import { ApiError, get } from "./api";
import { settings } from "./settings.svelte";
import type { Service, SiteFacts } from "./state";

class Site {
  service = $state.raw<Service | null>(null);
  facts = $state.raw<SiteFacts | null>(null);
  /** Refusal of the last try, null after a good one. */
  refusal = $state<{ status: number; text: string } | null>(null);
  private loading = false;

  /** Zone of local times: the site's, the browser's (undefined), or the one that was set. */
  zone = $derived(
    settings.zone === "browser" ? undefined : settings.zone === "site" ? (this.facts?.time_zone ?? undefined) : settings.zone,
  );
  /** True where this service commands the site, and the page may ask it. */
  commands = $derived(this.service?.kind === "site" && this.service.commands);

  async load(): Promise<void> {
    if (this.loading) return;
    this.loading = true;
    try {
      this.service = await get<Service>("/api/service");
      if (this.service.kind !== "result") this.facts = await get<SiteFacts>("/api/site");
      this.refusal = null;
    } catch (error) {
      this.refusal = error instanceof ApiError ? { status: error.status, text: error.message } : { status: 0, text: String(error) };
    } finally {
      this.loading = false;
    }
  }
}

export const site = new Site();
