// Instants are MJD in UTC everywhere; these are their texts.

const UNIX_EPOCH_MJD = 40587;
const DAY_MS = 86_400_000;

/** MJD of now by this machine's clock; the site's own is live.now(). */
export function mjdNow(): number {
  return UNIX_EPOCH_MJD + Date.now() / DAY_MS;
}

export function dateOf(mjd: number): Date {
  return new Date(Math.round((mjd - UNIX_EPOCH_MJD) * DAY_MS));
}

export function mjdOf(date: Date): number {
  return UNIX_EPOCH_MJD + date.getTime() / DAY_MS;
}

/** "hh:mm:ss UTC", with the date before it where asked for. */
export function utc(mjd: number | null | undefined, form: "time" | "full" = "time"): string {
  if (mjd == null || !Number.isFinite(mjd)) return "no time";
  const text = dateOf(mjd).toISOString();
  return form === "full" ? `${text.slice(0, 10)} ${text.slice(11, 19)} UTC` : `${text.slice(11, 19)} UTC`;
}

/** The same instant by the wall clock of a zone of the IANA, "hh:mm:ss GMT+1"; null: this browser's zone. */
export function local(mjd: number | null | undefined, timezone?: string | null): string {
  if (mjd == null || !Number.isFinite(mjd)) return "no time";
  return formatOf(timezone ?? undefined).format(dateOf(mjd));
}

const FORMATS = new Map<string | undefined, Intl.DateTimeFormat>();

/** Format of a zone, made once; in the first English that has a name for it ("EST", "CET"), else with its offset. */
function formatOf(zone: string | undefined): Intl.DateTimeFormat {
  const known = FORMATS.get(zone);
  if (known) return known;
  const formats = ["en-GB", "en-US", "en-AU", "en-ZA"].map((language) => made(language, zone));
  const named = formats.find((each) => !each.formatToParts(0).some((part) => part.type === "timeZoneName" && part.value.startsWith("GMT")));
  const format = named ?? (formats[0] as Intl.DateTimeFormat);
  FORMATS.set(zone, format);
  return format;
}

function made(language: string, zone: string | undefined): Intl.DateTimeFormat {
  const form: Intl.DateTimeFormatOptions = { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23", timeZoneName: "short" };
  try {
    return new Intl.DateTimeFormat(language, { ...form, timeZone: zone });
  } catch {
    return new Intl.DateTimeFormat(language, form); // a zone that this browser does not know
  }
}

/** Age in the shortest true words: "0.4 s", "12 s", "3 min", "2 h", "5 d". */
export function age(seconds: number): string {
  if (!Number.isFinite(seconds)) return "unknown";
  const s = Math.max(0, seconds);
  if (s < 10) return `${s.toFixed(1)} s`;
  if (s < 120) return `${Math.floor(s)} s`;
  if (s < 7200) return `${Math.floor(s / 60)} min`;
  if (s < 172_800) return `${Math.floor(s / 3600)} h`;
  return `${Math.floor(s / 86_400)} d`;
}
