// Links between pages that keep the replay's instant and its run.
import { href, route } from "../../lib/route.svelte";

type Query = Record<string, string | number | null | undefined>;

export const link = (page: string, query: Query = {}): string => href(page, { at: route.query.at, run: route.query.run, ...query });
export const shotLink = (number: number | string): string => link("shot", { shot: number });
export const pointLink = (name: string): string => link("point", { point: name });
export const rangerLink = (name: string): string => link("ranger", { ranger: name });
