"""The sources that docstrings cite as [KEY]: title, where to find it, which equations are used, which errors it has.

A test fails on a citation without an entry here, and on an entry that nothing cites.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """One cited work.

    title      authors, title, publication, year
    locator    DOI, or report number where there is none
    used       the equations or tables that catseye uses
    errata     errors found in it, one line each, and what is right
    """

    title: str
    locator: str
    used: str
    errata: tuple[str, ...] = ()


SOURCES: dict[str, Source] = {
    "PARKER04": Source(
        title="D. H. Parker, Working notes on the Green Bank Telescope laser metrology system, 2004",
        locator="National Radio Astronomy Observatory, 29 April 2004",
        used="chapters 1 to 5: eqs. 1.1-1.53, 2.1-2.47, 3.1-3.7, 4.1-4.14, 5.1-5.19",
        errata=(
            "1.12 prints p_r where 1.18 uses the temperature-corrected p_t",
            "1.31 prints + phi/2pi, 5.18 requires minus; 1.32-1.34 and 1.36-1.38 carry the wrong sign with it",
            "1.34 prints 6283 rad (c taken as 3e8 m/s); 1.32 gives 6287.535 rad",
            "2.14 and 5.4 print arctan(b/a): the quadrant matters",
            "2.44 omits the plus signs between X_r and its offset",
            "2.5 (example) says the y origin is the tooling ball of ZY2: z is meant",
            "5.14 and 5.17 print -2pi(n_i - n_0); 5.12 and 5.15 require +2pi(n_i - n_0)",
        ),
    ),
    "GOLDMAN00": Source(
        title="M. A. Goldman, Calibration of the GBT triplet retroreflector units, 2000",
        locator="National Radio Astronomy Observatory, 29 June 2000",
        used="eqs. 3.8-3.10, 3.14, 3.17, B.1, figure 10",
        errata=(
            "3.19 prints (delta1 + delta2)/2 inside the root; (delta1 + delta2)/Delta is right",
            "3.13 and 3.16 slip by a half wavelength where range and D_TOPPL straddle a boundary: use the nearest integer",
            "D.3 gives n_air at 20.5 C, the value belongs to 20.0 C; D.4 prints -0.985e-6, -0.895887e-6 is right",
        ),
    ),
}
