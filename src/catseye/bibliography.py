"""Sources cited as [KEY] in docstrings: title, location, equations used, errata.

A test fails on a citation without an entry here, and on an uncited entry.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """Cited work.

    title      authors, title, publication, year
    locator    DOI, or report number
    used       equations or tables used
    errata     errors found in it, with corrections, one line each
    """

    title: str
    locator: str
    used: str
    errata: tuple[str, ...] = ()


SOURCES: dict[str, Source] = {
    "ISA182": Source(
        title="ANSI/ISA-18.2-2016, Management of alarm systems for the process industries",
        locator="International Society of Automation, 2016",
        used="states of an alarm and their transitions: acknowledged, returned, shelved (`coordinator.alarms`)",
    ),
    "PARKER04": Source(
        title="D. H. Parker, Working notes on the Green Bank Telescope laser metrology system, 2004",
        locator="National Radio Astronomy Observatory, 29 April 2004",
        used="chapter 1, eqs. 1.3-1.53: humidity, barometer, index of air and glass, a path as a refractometer "
        "(`atmosphere`, `optics.glass`, `optics.glass_table`, `reduction.air`); chapter 2, section 2.1, eqs. 2.3-2.26, "
        "2.40-2.47: frames, mirror, counts, track, Sun (`geometry`, `ranger`, `reduction.site`, `reduction.steering`), "
        "a telescope that bends and swings (`reduction.structure`, `reduction.pose`); chapter 3, eqs. 3.1-3.7: "
        "positions and their differences (`estimation.network.positions`, `estimation.deformation.differential`, "
        "`reduction.deformation`), sections 3.2 and 3.3: networks, plans, layouts (`records.network`, "
        "`reduction.network`, `reduction.design`); chapter 4, eqs. 4.1-4.14: speed of sound (`atmosphere.sound`, "
        "`reduction.air`); chapter 5, eqs. 5.1-5.19: phase, whole cycles, range (`signal`, `ranger.ranging`, "
        "`reduction.detection`, `reduction.epoch`, `reduction.live`, `reduction.budget`); chapter 6, items 1 and 3 to "
        "6, sections 6.1-6.3: lens, multiple paths, feedback, amplitude, coatings, retroreflectors, beam, servo "
        "(`optics`, `signal.systematics`, `reduction.optics`); chapters 7 and 8: what is to be calibrated and was "
        "measured (`reduction.calibrations`, `reduction.baseline`, `reduction.scans`); chapter 11: the panel setting "
        "instrument (`reduction.panels`). `simulator` writes what it needs a second time",
        errata=(
            "1.2 prints 384 615.3 GHz for 780 nm (c taken as 3e8 m/s); 384 349.3 GHz, the sidebands likewise",
            "1.11 names the local station pressure p_t, p_l is meant; there is no 1.17",
            "1.12 prints p_r where 1.18 uses the temperature-corrected p_t",
            "1.22 prints 929.37 mb, truncated twice: 929.38",
            "1.31 prints + phi/2pi, 5.18 requires minus; 1.32-1.34 and 1.36-1.38 carry the wrong sign with it",
            "1.34 prints 6283 rad (c taken as 3e8 m/s); 1.32 gives 6287.535 rad",
            "1.39's example calls 0.5 rad 80 °C; 1.32 and 1.50 give 5.633 mrad a kelvin at 100 m: 88.8 °C, 11 % more",
            "figure 1.1 (REFRACT.EQ): wave[] divides by 2, half the group wavelength of 1.27: 99.9 for 199.8 mm",
            "2.14 and 5.4 print arctan(b/a): the quadrant matters",
            "2.2.2, step 4: beta1 is minus the y displacement of the autocollimator (its own example 2.36 is right)",
            "2.4, step 6 zeroes y with the autocollimator along z^: that is Theta = beta1, not 0",
            "2.4: both autocollimation distances differ by the axis offset, not by the mirror's (`mirror_path`)",
            "2.5, step 2 surveys x^'s azimuth, a quarter turn before 2.6's; step 4 cites 2.12 for lambda: 2.11",
            "2.44 omits the plus signs between X_r and its offset",
            "3.1 says the coordinates are unique: three ranges give two points, mirror images in the stations' plane",
            "2.5 (example) says the y origin is the tooling ball of ZY2: z is meant",
            "chapter 6, item 1: by the group index alone the middle of a lens comes late, not the edge",
            "figure 1.1 (REFRACT.EQ) sets the wet bulb tp = t after the psychrometer's equations, which then see "
            "saturated air",
            "4.3 prints gamma_w = 1.004 for water vapour, about 1.33 is right: humid air 0.5 m/s faster at 20 °C, 50 %",
            "figure 4.1 (SOUND.EQ) takes the power 1/2 of 4.3's bracket, -1/2 is right (4.8): 0.39 m/s too slow at 4.8",
            "figure 2.5 (CAL.EQ): ArcTan without 2.19, a whole turn, 100 000 counts, off between -pi and -pi/2",
            "5.1.3 says the detected signal is mixed with 1500.000 MHz; 5.1.1, + IF, is right",
            "5.2: clipping on top shifts a single edge, not the average of both edges that the Clark-Hess meter takes",
            "5.8 takes quadrature for the extreme: arcsin(r), not arctan(r); 7.9 um more at 10:1, 8 pm at 1000:1",
            "5.9 prints -2pi/lambda/2; -2pi/(lambda/2) is meant",
            "5.14 and 5.17 print -2pi(n_i - n_0); 5.12 and 5.15 require +2pi(n_i - n_0)",
        ),
    ),
    "GOLDMAN00": Source(
        title="M. A. Goldman, Calibration of the GBT triplet retroreflector units, 2000",
        locator="National Radio Astronomy Observatory, 29 June 2000",
        used="eqs. 3.8-3.10, 3.14 and B.1: what glass adds (`optics.retroreflector`, `optics.glass`, "
        "`reduction.epoch.coordinates`, `reduction.calibrations.ranging`); "
        "sections 1.3, 2.2, 2.3, 3.1-3.4, eqs. 3.5, 3.11-3.29: a unit (`records.laboratory.triplet_measurement`, "
        "`reduction.triplet.unit`, `reduction.triplet.plate`, `reduction.triplet.geometry`, `reduction.triplet.memo`, "
        "`gateways.triplet`); eqs. "
        "3.13, 3.16: its whole cycles (`signal.cycles.whole`); A.1-A.8, D.1-D.5: tolerances "
        "(`reduction.triplet.tolerances`, `reduction.triplet.sensitivity`, `reduction.triplet.bounds`); section 1.1, "
        "appendix C, figure 10: a unit on the telescope (`reduction.site.places`, `coordinator.visibility.vantage`, "
        "`reduction.triplet.use`, `reduction.triplet.ties`, "
        "`reduction.triplet.reduced_ranges`, "
        "`reduction.triplet.local_net`, `reduction.triplet.aiming`, `geometry.antenna.triplet_mount`); eqs. 3.2-3.7: a "
        "hollow target (`reduction.triplet.hollow`); sections 1.2, 3.3: a record (`reduction.triplet.installed`)",
        errata=(
            "3.19 prints (delta1 + delta2)/2 inside the root; (delta1 + delta2)/Delta is right",
            "3.19a, leaves D_12^2 (delta1 + delta2) / 16 Delta^2 out: 15 um at 18 m",
            "two equations are numbered 3.8, two 3.16, two 3.20",
            "3.11a, 3.15b and the second 3.16 write (1 - sgn)/2, a half at equal phases; 3.13a and 3.16a give none",
            "3.3 prints Phi_Cal beside cycles: Phi_Cal/2pi is right",
            "3.12 bounds a sum of phases in rad by 1: 1/2pi is missing, the bound is one cycle, 6.28 rad",
            "3.13 and 3.16 slip by a half wavelength where range and D_TOPPL straddle a boundary: round to the nearest",
            "1.3 has prisms 38.10 mm high, 3.4 some 38.4: 0.20 mm of H_rp, 0.26 mm of P_c; sheets have their own",
            "3.25 takes arcsin of leg over leg, arctan is right: 2.7 urad, 9 nm of H_corr, before a prism at 18 m",
            "3.23 with D_TOPPL good to 2 mm gives incidences to some mrad, and none where D_0 exceeds D_1",
            "3.4's table: H_rp is 25.146 mm for a 38.4 mm prism, not 25.2; P_c of the ball -173.715 mm, not -173.6",
            "A, third case: the law of cosines, not Pythagoras; the bound holds while h is below D_12/2",
            "A.8 needs the perpendicular from S to fall between the prisms",
            "C takes A-T-S for the incidence, but the prisms' normals are parallel",
            "D.1's 1.527077 is of unrounded indices; D.2 over D.3 as printed gives 1.527076",
            "D: not insignificant for H_corr, the ball has 108 mm more glass: 1.1 um for 1e-5 of the index ratio",
            "D.3 gives n_air at 20.5 C, the value belongs to 20.0 C; D.4 prints -0.985e-6, -0.895887e-6 is right",
        ),
    ),
    "SHUSTER93": Source(
        title="M. D. Shuster, A survey of attitude representations, Journal of the Astronautical Sciences 41, 1993",
        locator="J. Astronaut. Sci. 41 (4), pages 439-517",
        used="the rotation vector and Rodrigues' formula; the cross-product matrix, there with the opposite sign",
    ),
    "SHEPPERD78": Source(
        title="S. W. Shepperd, Quaternion from rotation matrix, Journal of Guidance and Control 1, 1978",
        locator="doi:10.2514/3.55767b",
        used="the choice of the largest quaternion element",
    ),
    "SCHOTT14": Source(
        title="Schott AG, Data sheet N-BK7 517642.251, 2014",
        locator="Schott optical glass data sheets, 1 February 2014",
        used="the six constants of the Sellmeier dispersion formula, 312.6 to 2325.4 nm; of dn/dT; expansion",
    ),
    "TIE29": Source(
        title="Schott AG, Technical information TIE-29: Refractive index and dispersion, 2005",
        locator="Schott Advanced Optics, April 2005",
        used="section 1: catalogue indices are relative to air",
    ),
    "RUEGER90": Source(
        title="J. M. Rüeger, Electronic Distance Measurement: An Introduction, third edition, Springer, 1990",
        locator="doi:10.1007/978-3-642-97196-9",
        used="eqs. 5.23, 5.24, 5.27-5.29 (`atmosphere.weather`), A.4, A.5, A.10 (`atmosphere.index.rueger1990`), as "
        "PARKER04 quotes them; the resolutions of 1960 and 1963 with BARRELL39's formula "
        "(`atmosphere.index.barrell_sears1963`); velocity corrections (`atmosphere.sound.velocity`) and the reduction "
        "of slope distances (`reduction.baseline.lengths`, `reduction.network`); cyclic errors "
        "(`signal.systematics.cyclic`, `reduction.calibrations.ranging`); wet bulbs and their slopes "
        "(`atmosphere.index.hygrometer`, `reduction.air`); slopes of the index (`reduction.triplet.tolerances`)",
    ),
    "OWENS67": Source(
        title="J. C. Owens, Optical refractive index of air: dependence on pressure, temperature and composition, 1967",
        locator="doi:10.1364/AO.6.000051",
        used="density factors of dry air and vapour, dispersion of vapour",
        errata=(
            "its dry coefficients imply an ice point of 273.16 K (our inference): at 273.15 K, 1e-8 of index too much",
        ),
    ),
    "PECK72": Source(
        title="E. R. Peck and K. Reeder, Dispersion of air, 1972",
        locator="doi:10.1364/JOSA.62.000958",
        used="the two-resonance dispersion of dry air, scaled to Owens' density factor",
    ),
    "CIDDOR96": Source(
        title="P. E. Ciddor, Refractive index of air: new equations for the visible and near infrared, 1996",
        locator="doi:10.1364/AO.35.001566",
        used="eqs. 1-3, 5 and the constants of appendix A: dispersion, compressibility, saturation, enhancement",
        errata=("its procedure for the group index is not rigorous: CIDDOR99 replaces it",),
    ),
    "CIDDOR99": Source(
        title="P. E. Ciddor and R. J. Hill, Refractive index of air. 2. Group index, 1999",
        locator="doi:10.1364/AO.38.001663",
        used="group refractivity of dry air and of vapour",
        errata=("B2 has the wrong sign in the derivative of the dry-air term, 1e-6 of index; it is positive",),
    ),
    "IAG99": Source(
        title="International Association of Geodesy, resolution 3 of the XXII General Assembly, Birmingham, 1999",
        locator="IUGG XXII General Assembly, July 1999, IAG resolution 3",
        used="the choice of CIDDOR96 with CIDDOR99 for work better than 1 ppm; the closed formula for other work",
    ),
    "IAPWS97": Source(
        title="IAPWS, Revised release on the industrial formulation 1997 for water and steam, 2012",
        locator="IAPWS R7-97(2012)",
        used="eq. 30 and table 34: saturation pressure; table 35 as test values",
    ),
    "MURPHY05": Source(
        title="D. M. Murphy and T. Koop, Review of the vapour pressures of ice and supercooled water, 2005",
        locator="doi:10.1256/qj.04.94",
        used="eqs. 7 and 10: vapour pressure of ice and of supercooled water, as yardsticks below 0 °C",
    ),
    "BAARDA68": Source(
        title="W. Baarda, A testing procedure for use in geodetic networks, 1968",
        locator="Netherlands Geodetic Commission, Publications on Geodesy, New Series 2 (5), Delft",
        used="data snooping: the w test, and the smallest error found at the level 0.1 % with power 80 %",
    ),
    "FOERSTNER16": Source(
        title="W. Förstner and B. P. Wrobel, Photogrammetric Computer Vision, Springer, 2016",
        locator="doi:10.1007/978-3-319-11550-4",
        used="chapter 2: propagation, standard ellipsoids (`estimation.quality.ellipsoid`); chapter 4: Gauss-Markov "
        "model with priors and constraints, evaluation, tests, robust estimation (`estimation.least_squares`, "
        "`estimation.quality`, `estimation.network`, `estimation.deformation`, `estimation.design`, "
        "`reduction.calibrations`, `reduction.network`, `reduction.air`, `reduction.live`, `reduction.triplet`, "
        "`signal.systematics`); chapter 15: "
        "elimination of points from the normal equations (`estimation.network.multilateration`)",
    ),
    "HUBER09": Source(
        title="P. J. Huber and E. M. Ronchetti, Robust Statistics, second edition, Wiley, 2009",
        locator="doi:10.1002/9780470434697",
        used="iterated reweighting by the size of the residual",
    ),
    "JCGM100": Source(
        title="JCGM, Evaluation of measurement data: guide to the expression of uncertainty in measurement, 2008",
        locator="JCGM 100:2008",
        used="4.2.3, 5.1.3, 5.1.4, F.2, eqs. 10, 13, 16 and G.2b (combined uncertainty, degrees of freedom), annex H.1",
    ),
    "BAARDA73": Source(
        title="W. Baarda, S-transformations and criterion matrices, Netherlands Geodetic Commission, 1973",
        locator="Publications on Geodesy, New Series 5 (1), Delft, second edition 1981",
        used="the transformation of coordinates and covariance from one datum to another",
    ),
    "DAVIS05": Source(
        title="T. A. Davis, Algorithm 849: a concise sparse Cholesky factorization package, ACM TOMS 31, 2005",
        locator="doi:10.1145/1114268.1114277",
        used="the symbolic and the numeric factorisation L D L', row by row",
    ),
    "TAKAHASHI73": Source(
        title="K. Takahashi, J. Fagan, M. Chen, Formation of a sparse bus impedance matrix, 1973",
        locator="8th PICA Conference Proceedings, Minneapolis, pages 63-69",
        used="the recurrence for the entries of an inverse on the pattern of its factor",
    ),
    "KABSCH76": Source(
        title="W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta Cryst. A 32, 1976",
        locator="doi:10.1107/S0567739476001873",
        used="closed form of the best rotation between two sets of points",
    ),
    "UMEYAMA91": Source(
        title="S. Umeyama, Least-squares estimation of transformation parameters between two point patterns, 1991",
        locator="doi:10.1109/34.88573",
        used="the sign that keeps the rotation proper, and the scale",
    ),
    "MILLS10": Source(
        title="D. Mills, J. Martin, J. Burbank, W. Kasch, Network Time Protocol Version 4: Protocol and Algorithms "
        "Specification, Internet Engineering Task Force, 2010",
        locator="RFC 5905",
        used="section 10, the clock filter; section 11.2, selection and combination (`coordinator.link.clock_watch`, "
        "`coordinator.guard.clocks`)",
    ),
    "SQLITE24": Source(
        title="D. R. Hipp and others, Database File Format, SQLite documentation, 2024",
        locator="sqlite.org, fileformat2",
        used="sections 1.3, 1.6, 2.1 and 4.1: header, pages, records, log (`coordinator.journal.recovery`)",
    ),
    "PELZER71": Source(
        title="H. Pelzer, Zur Analyse geodätischer Deformationsmessungen, 1971",
        locator="Deutsche Geodätische Kommission, Reihe C, Heft 164, München",
        used="the global congruence test and the localisation of moved points",
    ),
    "CASPARY87": Source(
        title="W. F. Caspary, Concepts of network and deformation analysis, 1987",
        locator="Monograph 11, School of Surveying, University of New South Wales",
        used="congruence test, homogeneity of epochs, localisation, strain and rigid-body models "
        "(`estimation.deformation`)",
    ),
    "RAO73": Source(
        title="C. R. Rao, Linear Statistical Inference and Its Applications, second edition, Wiley, 1973",
        locator="doi:10.1002/9780470316436",
        used="section 4i: least squares with a singular covariance",
    ),
    "POPE72": Source(
        title="A. J. Pope, Some pitfalls to be avoided in the iterative adjustment of nonlinear problems, 1972",
        locator="Proceedings of the 38th Annual Meeting, American Society of Photogrammetry, pages 449-477",
        used="derivatives at adjusted observations where both sides of a relation are observed",
    ),
    "FEDOROV72": Source(
        title="V. V. Fedorov, Theory of Optimal Experiments, Academic Press, 1972",
        locator="ISBN 978-0-12-250750-3",
        used="sequential design: each further observation the best after those before it",
    ),
    "BIRGIN00": Source(
        title="E. G. Birgin, J. M. Martinez and M. Raydan, Nonmonotone spectral projected gradient methods on convex "
        "sets, SIAM Journal on Optimization 10, 2000",
        locator="doi:10.1137/S1052623497330963",
        used="descent of a design's criterion within regions",
    ),
    "CROCCO12": Source(
        title="M. Crocco, A. Del Bue and V. Murino, A bilinear approach to the position self-calibration of multiple "
        "sensors, 2012",
        locator="IEEE Transactions on Signal Processing 60 (2), pages 660-673",
        used="factors of the squared ranges between two unknown sets of points, and the small matrix that mixes them",
    ),
    "POLLEFEYS08": Source(
        title="M. Pollefeys and D. Nistér, Direct computation of sound and microphone locations from "
        "time-difference-of-arrival data, 2008",
        locator="doi:10.1109/ICASSP.2008.4518142",
        used="the linear upgrade of the factors where ten points of a kind are there",
    ),
    "KUANG13": Source(
        title="Y. Kuang, S. Burgess, A. Torstensson and K. Åström, A complete characterization and solution to the "
        "microphone position self-calibration problem, 2013",
        locator="IEEE International Conference on Acoustics, Speech and Signal Processing 2013, pages 3875-3879",
        used="least numbers of stations and targets: 4 x 6 and 5 x 5",
    ),
    "TORGERSON52": Source(
        title="W. S. Torgerson, Multidimensional scaling: I. Theory and method, Psychometrika 17, 1952",
        locator="doi:10.1007/BF02288916",
        used="points from all their distances by the eigenvectors of the doubly centred squares",
    ),
    "GAMA18": Source(
        title="A. Cepek, GNU Gama: adjustment of geodetic networks, manual and schema gama-local.xsd 1.00, 2018",
        locator="https://www.gnu.org/software/gama/manual/",
        used="chapter XML input data format for gama-local; the elements of gama-local-adjustment.xsd 1.00",
    ),
    "STARNET04": Source(
        title="STAR*NET V6 Least Squares Survey Adjustment Program, Reference Manual, Standard and PLUS Editions, 2004",
        locator="Starplus Software, Oakland",
        used="chapter 5, Preparing input data (`records.network.starnet`)",
    ),
    "POPE76": Source(
        title="A. J. Pope, The statistics of residuals and the detection of outliers, 1976",
        locator="NOAA Technical Report NOS 65 NGS 1, Rockville",
        used="the tau test and its relation to Student's t",
    ),
    "SIDAK67": Source(
        title="Z. Šidák, Rectangular confidence regions for the means of multivariate normal distributions, 1967",
        locator="doi:10.1080/01621459.1967.10482935",
        used="theorem 1: the level of one among many two-sided tests",
    ),
    "BENJAMINI95": Source(
        title="Y. Benjamini and Y. Hochberg, Controlling the false discovery rate, 1995",
        locator="doi:10.1111/j.2517-6161.1995.tb02031.x",
        used="section 3: the step-up procedure",
    ),
    "BEATON74": Source(
        title="A. E. Beaton and J. W. Tukey, The fitting of power series, meaning polynomials, 1974",
        locator="doi:10.1080/00401706.1974.10489171",
        used="the biweight",
    ),
    "YANG02": Source(
        title="Y. Yang, L. Song and T. Xu, Robust estimator for correlated observations, 2002",
        locator="doi:10.1007/s00190-002-0256-7",
        used="the IGG III weight function",
    ),
    "GEMAN87": Source(
        title="S. Geman and D. E. McClure, Statistical methods for tomographic image reconstruction, 1987",
        locator="Bulletin of the International Statistical Institute 52 (4), pages 5-21",
        used="the weight function",
    ),
    "BLACK96": Source(
        title="M. J. Black and A. Rangarajan, On the unification of line processes, outlier rejection, and robust "
        "statistics with applications in early vision, 1996",
        locator="doi:10.1007/BF00131148",
        used="annealing the width of a redescending estimator",
    ),
    "TORR00": Source(
        title="P. H. S. Torr and A. Zisserman, MLESAC: a new robust estimator, 2000",
        locator="doi:10.1006/cviu.1999.0832",
        used="the truncated cost of a choice drawn at random",
    ),
    "FOERSTNER79": Source(
        title="W. Förstner, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten, 1979",
        locator="Allgemeine Vermessungs-Nachrichten 86, pages 446-453",
        used="the fixed point of variance components",
    ),
    "SCHMIDT66": Source(
        title="S. F. Schmidt, Application of state-space methods to navigation problems, 1966",
        locator="doi:10.1016/B978-1-4831-6716-9.50011-4",
        used="consider parameters: a covariance that takes in what is not estimated",
    ),
    "PATTERSON71": Source(
        title="H. D. Patterson and R. Thompson, Recovery of inter-block information, 1971",
        locator="doi:10.1093/biomet/58.3.545",
        used="restricted maximum likelihood and its information",
    ),
    "HAUSMAN78": Source(
        title="J. A. Hausman, Specification tests in econometrics, 1978",
        locator="doi:10.2307/1913827",
        used="lemma 2.1: two least squares of which one has more data differ by the difference of their covariances",
    ),
    "WORSLEY82": Source(
        title="K. J. Worsley, An improved Bonferroni inequality and applications, 1982",
        locator="doi:10.1093/biomet/69.2.297",
        used="upper bound of the probability of a union by pairs along a tree (`estimation.series.change`)",
    ),
    "WORSLEY83": Source(
        title="K. J. Worsley, Testing for a two-phase multiple regression, 1983",
        locator="doi:10.1080/00401706.1983.10487817",
        used="largest F statistic over the times of a change (`estimation.series.change`)",
    ),
    "SCHWARZ78": Source(
        title="G. Schwarz, Estimating the dimension of a model, 1978",
        locator="doi:10.1214/aos/1176344136",
        used="information criterion of two models (`estimation.series.steps`)",
    ),
    "HARVEY89": Source(
        title="A. C. Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, Cambridge, 1989",
        locator="doi:10.1017/CBO9781107049994",
        used="chapter 3: likelihood and regression by the innovations of a filter (`estimation.series.correlated`)",
    ),
    "JCGM102": Source(
        title="JCGM, Extension of the guide to any number of output quantities, 2011",
        locator="JCGM 102:2011",
        used="clause 6.5.2: coverage factors of ellipsoidal regions",
    ),
    "RILEY08": Source(
        title="W. J. Riley, Handbook of frequency stability analysis, NIST Special Publication 1065, 2008",
        locator="NIST SP 1065",
        used="eq. 11 (overlapping Allan deviation), tables 3 and 5, section 12 (series of 1000 readings)",
    ),
    "WHITTLE53": Source(
        title="P. Whittle, Estimation and information in stationary time series, Arkiv för Matematik, 1953",
        locator="doi:10.1007/BF02590998",
        used="likelihood of a periodogram",
    ),
    "RIFE74": Source(
        title="D. C. Rife and R. R. Boorstyn, Single-tone parameter estimation from discrete-time observations, 1974",
        locator="doi:10.1109/TIT.1974.1055282",
        used="Cramér-Rao bounds of amplitude, phase and frequency of a tone in white noise",
    ),
    "ISO19": Source(
        title="ISO 5725-2, Accuracy of measurement methods and results, part 2: repeatability and reproducibility",
        locator="ISO 5725-2:2019",
        used="section 7.4: mean squares within and between, unequal sets",
    ),
    "SIEGMAN86": Source(
        title="A. E. Siegman, Lasers, University Science Books, 1986",
        locator="ISBN 978-0-935702-11-8",
        used="chapters 15, 17 (eqs. 17.4, 17.5, 17.11), 20: ray matrices, Gaussian beams, share through an aperture, "
        "the Huygens integral (`optics.abcd`, `optics.gaussian_beam`, `optics.spot`, `reduction.optics`, "
        "`reduction.calibrations.mirror`)",
    ),
    "GOODMAN05": Source(
        title="J. W. Goodman, Introduction to Fourier optics, third edition, Roberts, 2005",
        locator="ISBN 978-0-9747077-2-3",
        used="chapter 4: Fresnel's diffraction integral; Parseval's theorem",
    ),
    "YARIV97": Source(
        title="A. Yariv, Optical electronics in modern communications, fifth edition, Oxford, 1997",
        locator="ISBN 978-0-19-510626-8",
        used="chapter 10: shot noise and thermal noise of optical detection",
    ),
    "IRVINE81": Source(
        title="H. M. Irvine, Cable structures, MIT Press, 1981",
        locator="ISBN 978-0-262-09023-3",
        used="section 1.4: the elastic catenary",
    ),
    "ISO22": Source(
        title="ISO 1, Standard reference temperature for the specification of geometrical properties",
        locator="ISO 1:2022",
        used="20 °C",
    ),
    "HARRIS78": Source(
        title="F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, 1978",
        locator="doi:10.1109/PROC.1978.10837",
        used="the Hann window and its equivalent noise bandwidth of 1.5 bins",
    ),
    "GRANDKE83": Source(
        title="T. Grandke, Interpolation algorithms for discrete Fourier transforms of weighted signals, 1983",
        locator="doi:10.1109/TIM.1983.4315077",
        used="frequency from the two largest bins under a Hann window",
    ),
    "LANG80": Source(
        title="R. Lang and K. Kobayashi, External optical feedback effects on semiconductor injection laser, 1980",
        locator="doi:10.1109/JQE.1980.1070479",
        used="the laser with a weak reflector: stationary phase condition",
    ),
    "ACKET84": Source(
        title="G. A. Acket, D. Lenstra, A. J. den Boef, B. H. Verbeek, The influence of feedback intensity, 1984",
        locator="doi:10.1109/JQE.1984.1072281",
        used="the feedback parameter C",
    ),
    "ISO98": Source(
        title="ISO 3650, Geometrical product specifications, length standards, gauge blocks, 1998",
        locator="ISO 3650:1998",
        used="definition of a gauge block's length, wrung",
    ),
    "JCGM101": Source(
        title="JCGM, Propagation of distributions using a Monte Carlo method, supplement 1 to the guide, 2008",
        locator="JCGM 101:2008",
        used="clauses 6.4 (distributions), 7.2-7.9 (Monte Carlo, tolerance), 8.1 (validation), 9.2 and 9.4 (tests)",
    ),
    "ISO12": Source(
        title="ISO 17123-4, Field procedures for testing geodetic instruments: electro-optical distance meters, 2012",
        locator="ISO 17123-4:2012",
        used="full test procedure: zero-point correction, experimental standard deviation, statistical tests a to c",
    ),
    "KENWARD97": Source(
        title="M. G. Kenward, J. H. Roger, Small sample inference for fixed effects from restricted likelihood, 1997",
        locator="doi:10.2307/2533558",
        used="what estimated variance components add to the covariance of the parameters",
    ),
    "TEUNISSEN95": Source(
        title="P. J. G. Teunissen, The least-squares ambiguity decorrelation adjustment, Journal of Geodesy 70, 1995",
        locator="doi:10.1007/BF00863419",
        used="section 2.2: integer least squares",
    ),
    "LOEFDAHL01": Source(
        title="M. G. Löfdahl and H. Eriksson, An algorithm for resolving 2 pi ambiguities in interferometric "
        "measurements by use of multiple wavelengths, 2001",
        locator="Optical Engineering 40, 2001",
        used="the problem of one length from phases at several wavelengths",
    ),
    "TEXAS13": Source(
        title="Texas Instruments, LM628/LM629 Precision motion controller, data sheet SNVS781C, revised March 2013",
        locator="SNVS781C, first issued by National Semiconductor",
        used="pages 9 to 24: trajectory parameters and their worked example, PID filter, commands, tables 1, 5 and 7",
        errata=("page 11 takes 341 us for the sample time of 341.33 us: 446 956 for 600 rpm runs at 599.4 rpm",),
    ),
    "CREAGER02": Source(
        title="R. E. Creager, ZY manual (laser ranger control program), National Radio Astronomy Observatory, 2002",
        locator="NRAO Green Bank, 11 March 2002",
        used="pages of the commands ABA, ABP, ABV, ACP, CWT, ERL, FHM, FIL, FKD, FLT",
    ),
    "KARNOPP85": Source(
        title="D. Karnopp, Computer simulation of stick-slip friction in mechanical dynamic systems, 1985",
        locator="doi:10.1115/1.3140698",
        used="friction that holds an axis at rest until the drive exceeds it",
    ),
    "FRANKLIN98": Source(
        title="G. F. Franklin, J. D. Powell, M. L. Workman, Digital Control of Dynamic Systems, third edition, 1998",
        locator="ISBN 0-201-82054-4",
        used="zero-order hold equivalents, discrete PID, margins of sampled loops (recalled, not at hand)",
    ),
    "SNYDER87": Source(
        title="J. P. Snyder, Map projections: a working manual, U.S. Geological Survey Professional Paper 1395, 1987",
        locator="doi:10.3133/pp1395",
        used="eqs. 4-18, 4-20 (radii of curvature), 14-4, 14-15, 15-1 to 15-9 (Lambert conformal conic)",
    ),
    "STEM89": Source(
        title="J. E. Stem, State Plane Coordinate System of 1983, NOAA Manual NOS NGS 5, 1989",
        locator="NOAA Manual NOS NGS 5, Rockville",
        used="zone 4702 West Virginia South, sign of the convergence, elevation and combined factors, Euler's radius",
    ),
    "TORGE12": Source(
        title="W. Torge and J. Müller, Geodesy, fourth edition, de Gruyter, 2012",
        locator="doi:10.1515/9783110250008",
        used="deflection of the vertical, Laplace's equation",
    ),
    "SOFA23": Source(
        title="IAU SOFA Board, IAU SOFA software collection, issue 2023-10-11",
        locator="https://www.iausofa.org",
        used="Atco13, by way of pyerfa: catalogue to observed place; pnm06a, gst06a, epv00, ab for the Sun",
    ),
    "LEEUWEN07": Source(
        title="F. van Leeuwen, Validation of the new Hipparcos reduction, Astronomy and Astrophysics 474, 2007",
        locator="doi:10.1051/0004-6361:20078357",
        used="proper motion and parallax of Polaris, HIP 11767",
    ),
    "TANAKA01": Source(
        title="M. Tanaka, G. Girard, R. Davis, A. Peuto, N. Bignell, Recommended table for the density of water, 2001",
        locator="doi:10.1088/0026-1394/38/4/3",
        used="eq. 1: density of water, 0 to 40 °C",
    ),
    "JAZWINSKI70": Source(
        title="A. H. Jazwinski, Stochastic Processes and Filtering Theory, Academic Press, 1970",
        locator="Mathematics in Science and Engineering, volume 64, Academic Press, New York",
        used="the extended Kalman filter, for the vibration of the structure",
    ),
    "SCHWEPPE65": Source(
        title="F. C. Schweppe, Evaluation of likelihood functions for Gaussian signals, 1965",
        locator="doi:10.1109/TIT.1965.1053737",
        used="the likelihood of a Kalman filter's innovations, for the modes of a vibration",
    ),
    "MEEUS98": Source(
        title="J. Meeus, Astronomical Algorithms, second edition, Willmann-Bell, 1998",
        locator="ISBN 0-943396-61-1",
        used="eqs. 16.3 and 16.4 (refraction), example 25.b (apparent place of the Sun, 1992 October 13.0 TD)",
    ),
    "IERS10": Source(
        title="G. Petit and B. Luzum (editors), IERS Conventions (2010), IERS Technical Note 36",
        locator="Verlag des Bundesamts für Kartographie und Geodäsie, Frankfurt am Main, 2010",
        used="chapter 5: UT1 and the turn of the Earth; its bulletins A and B give UT1 - UTC",
    ),
    "MIRTICH96": Source(
        title="B. V. Mirtich, Impulse-based dynamic simulation of rigid body systems, thesis, 1996",
        locator="University of California, Berkeley, 1996",
        used="conservative advancement: time to contact bounded from below by distance over rate",
    ),
    "DIJKSTRA59": Source(
        title="E. W. Dijkstra, A note on two problems in connexion with graphs, Numerische Mathematik 1, 1959",
        locator="doi:10.1007/BF01386390",
        used="problem 2: the shortest way",
    ),
    "ISO75": Source(
        title="ISO 2533:1975, Standard Atmosphere",
        locator="International Organization for Standardization, Geneva, 1975",
        used="section 2: pressure by height in the troposphere",
    ),
    "BARRELL39": Source(
        title="H. Barrell and J. E. Sears, The refraction and dispersion of air for the visible spectrum, 1939",
        locator="doi:10.1098/rsta.1939.0004",
        used="coefficients 287.604, 1.6288, 0.0136 and 5.5e-8 a mm Hg of vapour, as RUEGER90 quotes the resolutions",
    ),
    "IAPWS11": Source(
        title="IAPWS, Revised release on the pressure along the melting and sublimation curves of ordinary water, 2011",
        locator="IAPWS R14-08(2011); doi:10.1063/1.3657937",
        used="eq. 6: sublimation pressure; its check value at 230 K",
    ),
    "GREENSPAN76": Source(
        title="L. Greenspan, Functional equations for the enhancement factors for CO2-free moist air, 1976",
        locator="doi:10.6028/jres.080A.007",
        used="enhancement of saturation over ice, -100 to 0 °C",
    ),
    "WMOARC25": Source(
        title="WMO, World weather and climate extremes archive: highest and lowest sea level air pressure",
        locator="wmo.asu.edu, pressure",
        used="870 hPa (typhoon Tip, 1979) and 1084.8 hPa (Tosontsengel, 2001)",
    ),
    "WMO18": Source(
        title="WMO, Guide to instruments and methods of observation, WMO-No. 8, 2018",
        locator="WMO-No. 8, volume I, annex 4.B",
        used="psychrometer and saturation formulas, as a yardstick",
    ),
    "BERDAHL84": Source(
        title="P. Berdahl and M. Martin, Emissivity of clear skies, Solar Energy 32, 1984",
        locator="doi:10.1016/0038-092X(84)90144-0",
        used="emissivity of a clear sky by dew point, hour and pressure",
    ),
    "WATMUFF77": Source(
        title="J. H. Watmuff, W. W. S. Charters and D. Proctor, Solar and wind induced external coefficients, 1977",
        locator="Revue Internationale d'Héliotechnique (COMPLES) 2, page 56",
        used="heat transfer 2.8 + 3.0 wind, to 7 m/s",
    ),
    "SMITHSON51": Source(
        title="R. J. List, Smithsonian Meteorological Tables, sixth revised edition, 1951",
        locator="Smithsonian Miscellaneous Collections 114, publication 4014",
        used="gravity by latitude, table 167 (elevation), mercury and brass, as PARKER04 quotes them",
    ),
    "MORITZ80": Source(
        title="H. Moritz, Geodetic reference system 1980",
        locator="doi:10.1007/s001900050278",
        used="Somigliana's formula, its constants, gravity at equator and pole",
    ),
    "ICAO93": Source(
        title="ICAO, Manual of the ICAO standard atmosphere, third edition, 1993",
        locator="ICAO Doc 7488/3",
        used="pressure in a layer with a straight lapse; its table as test values",
    ),
    "RASMUSSEN06": Source(
        title="C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press, 2006",
        locator="ISBN 026218253X",
        used="eqs. 2.23, 2.24 (mean and covariance given observations), 4.17 (Matern covariance with 3/2), "
        "5.12 (an observation from the others); unknown means",
    ),
    "KAY93": Source(
        title="S. M. Kay, Fundamentals of Statistical Signal Processing: Estimation Theory, Prentice Hall, 1993",
        locator="ISBN 978-0-13-345711-7",
        used="section 3.11: Cramer-Rao bound of a delay, and its mean square bandwidth",
    ),
    "KNAPP76": Source(
        title="C. H. Knapp and G. C. Carter, The generalized correlation method for estimation of time delay, 1976",
        locator="doi:10.1109/TASSP.1976.1162830",
        used="weights of the cross-spectrum, the phase transform among them, and the variance with any weight",
    ),
    "WELCH67": Source(
        title="P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, 1967",
        locator="doi:10.1109/TAU.1967.1161901",
        used="the mean of windowed periodograms that overlap",
    ),
    "RICE44": Source(
        title="S. O. Rice, Mathematical analysis of random noise, Bell System Technical Journal 23 and 24, 1944-45",
        locator="doi:10.1002/j.1538-7305.1944.tb00874.x",
        used="section 3.6: how often noise passes a level",
    ),
    "CRAMER93": Source(
        title="O. Cramer, The variation of the specific heat ratio and the speed of sound in air, 1993",
        locator="doi:10.1121/1.405827",
        used="eq. 15 and table III: speed of sound, 0 to 30 °C",
    ),
    "LEMMON00": Source(
        title="E. W. Lemmon et al., Thermodynamic properties of air and mixtures of its gases, 2000",
        locator="doi:10.1063/1.1285884",
        used="ideal-gas heat capacity and second virial coefficient of dry air",
    ),
    "WAGNER02": Source(
        title="W. Wagner and A. Pruss, The IAPWS formulation 1995 for ordinary water substance, 2002",
        locator="doi:10.1063/1.1461829",
        used="table 6.1: ideal-gas heat capacity of water; molar mass",
    ),
    "HARVEY07": Source(
        title="A. H. Harvey and P. H. Huang, First-principles calculation of the air-water second virial coefficient",
        locator="doi:10.1007/s10765-007-0197-8",
        used="second virial coefficient of air with water",
    ),
    "HARVEY04": Source(
        title="A. H. Harvey and E. W. Lemmon, Correlation for the second virial coefficient of water, 2004",
        locator="doi:10.1063/1.1587731",
        used="second virial coefficient of water",
    ),
    "PICARD08": Source(
        title="A. Picard et al., Revised formula for the density of moist air (CIPM-2007), 2008",
        locator="doi:10.1088/0026-1394/45/2/004",
        used="composition and molar mass of dry air",
    ),
    "IAPWS10": Source(
        title="IAPWS, Guideline on an equation of state for humid air in contact with seawater and ice, 2010",
        locator="IAPWS G8-10",
        used="check of moist air's virial coefficients",
    ),
    "ISO93": Source(
        title="ISO 9613-1, Attenuation of sound during propagation outdoors: absorption by the atmosphere, 1993",
        locator="ISO 9613-1:1993",
        used="relaxation frequencies of oxygen and nitrogen",
    ),
    "PIERCE19": Source(
        title="A. D. Pierce, Acoustics, third edition, Springer, 2019",
        locator="doi:10.1007/978-3-030-11214-1",
        used="relaxation and dispersion; circular rays",
    ),
    "TARANTOLA05": Source(
        title="A. Tarantola, Inverse Problem Theory, SIAM, 2005",
        locator="doi:10.1137/1.9780898717921",
        used="least squares with Gaussian priors",
    ),
    "LEDOIT02": Source(
        title="O. Ledoit and M. Wolf, Some hypothesis tests for the covariance matrix when the dimension is large "
        "compared to the sample size, Annals of Statistics 30, 2002",
        locator="doi:10.1214/aos/1031689018",
        used="proposition 7: test of a sample covariance against the identity",
    ),
    "JOHNSTONE01": Source(
        title="I. M. Johnstone, On the distribution of the largest eigenvalue in principal components analysis, "
        "Annals of Statistics 29, 2001",
        locator="doi:10.1214/aos/1009210544",
        used="theorem 1.1: centre and width of the largest eigenvalue of a white sample covariance",
    ),
    "GEYER92": Source(
        title="C. J. Geyer, Practical Markov chain Monte Carlo, Statistical Science 7, 1992",
        locator="doi:10.1214/ss/1177011137",
        used="section 3.3: initial positive sequence estimator of the variance of a mean of correlated values",
    ),
    "MALITSON65": Source(
        title="I. H. Malitson, Interspecimen comparison of the refractive index of fused silica, 1965",
        locator="doi:10.1364/JOSA.55.001205",
        used="the three-term Sellmeier formula, 0.21 to 3.71 um, and lines of table I",
    ),
    "SCHOTT17": Source(
        title="Schott AG, Optical glass catalogue, 20 January 2017",
        locator="schott_2017-01-20b.agf, as refractiveindex.info records it",
        used="LITHOSIL-Q: constants of dn/dT and thermal expansion",
    ),
    "OHARA17": Source(
        title="Ohara Inc., Optical glass catalogue, 30 November 2017",
        locator="OHARA Zemax catalogue 2017-11-30, as refractiveindex.info records it",
        used="S-LAH79: Sellmeier constants, constants of dn/dT, thermal expansion",
    ),
    "TIE19": Source(
        title="Schott AG, Technical information TIE-19: Temperature coefficient of the refractive index",
        locator="Schott Advanced Optics, 2016",
        used="change of the absolute index with temperature; index of the reference air",
    ),
    "YODER58": Source(
        title="P. R. Yoder, Study of light deviation errors in triple mirrors and tetrahedral prisms, 1958",
        locator="doi:10.1364/JOSA.48.000496",
        used="deviation by dihedral errors, aperture and total reflection of corner reflectors",
    ),
    "SNYDER75": Source(
        title="J. J. Snyder, Paraxial ray analysis of a cat's-eye retroreflector, Applied Optics 14, 1975",
        locator="doi:10.1364/AO.14.001825",
        used="the mirror in the focus of the cat's-eye's front",
    ),
    "BORN99": Source(
        title="M. Born and E. Wolf, Principles of Optics, seventh edition, Cambridge University Press, 1999",
        locator="doi:10.1017/CBO9781139644181",
        used="section 1.4.2, eqs. 29, 30, 43: Stokes' parameters; section 1.5.2, eq. 21: Fresnel's formulae; section "
        "1.5.4, eq. 61: phases of total reflection; section 14.2, eq. 13: metals (`optics.polarization`); the same "
        "formulae squared, for the faces of a retroreflector (`optics.retroreflector.interface`); section 8: "
        "diffraction (`optics.gaussian_beam`)",
    ),
    "ISO17": Source(
        title="ISO/IEC 17025, General requirements for the competence of testing and calibration laboratories",
        locator="ISO/IEC 17025:2017",
        used="7.8: contents of a calibration certificate, statement of uncertainty and of conformity",
    ),
    "ILAC19": Source(
        title="ILAC, Guidelines on decision rules and statements of conformity, 2019",
        locator="ILAC-G8:09/2019",
        used="4.2.1 and 4.2.3: simple acceptance, and guarded acceptance with conditional statements",
    ),
    "JCGM106": Source(
        title="JCGM, Evaluation of measurement data: The role of measurement uncertainty in conformity "
        "assessment, 2012",
        locator="JCGM 106:2012",
        used="clause 7: conformity probability, two-sided tolerance interval, normal law",
    ),
    "YUN11": Source(
        title="G. Yun, K. Crabtree and R. A. Chipman, Three-dimensional polarization ray-tracing calculus I: "
        "definition and diattenuation, Applied Optics 50, 2011",
        locator="doi:10.1364/AO.50.002855",
        used="the 3 x 3 matrix of a surface, and that they multiply",
    ),
    "CHIPMAN18": Source(
        title="R. A. Chipman, W.-S. T. Lam and G. Young, Polarized Light and Optical Systems, CRC Press, 2018",
        locator="doi:10.1201/9781351129121",
        used="Jones matrices of wave plates, and of light that returns through them",
    ),
    "PECK62": Source(
        title="E. R. Peck, Polarization properties of corner reflectors and cavities, Journal of the Optical "
        "Society of America 52, 1962",
        locator="doi:10.1364/JOSA.52.000253",
        used="the six ways round a corner straight on; reference 99 of PARKER04",
    ),
    "PLAYER88": Source(
        title="M. A. Player, Polarization properties of a cube-corner reflector, Journal of Modern Optics 35, 1988",
        locator="J. Mod. Opt. 35 (11), pages 1813-1820",
        used="a lossless corner is a turn, a linear retarder and a turn; the index that makes a quarter wave",
        errata=(
            "the abstract prints 1.76476 for the quarter-wave corner; 1.767476 is right (our inference: a digit lost)",
        ),
    ),
    "LIU97": Source(
        title="J. Liu and R. M. A. Azzam, Polarization properties of corner-cube retroreflectors: theory and "
        "experiment, Applied Optics 36, 1997",
        locator="doi:10.1364/AO.36.001553",
        used="Jones matrices of the six propagation trips, straight on",
    ),
    "CHANG71": Source(
        title="R. F. Chang, D. G. Currie, C. O. Alley and M. E. Pittman, Far-field diffraction pattern for corner "
        "reflectors with complex reflection coefficients, Journal of the Optical Society of America 61, 1971",
        locator="doi:10.1364/JOSA.61.000431",
        used="six sectors added as amplitudes in the far field",
    ),
    "IEC14": Source(
        title="International Electrotechnical Commission, IEC 60825-1:2014, Safety of laser products, Part 1: "
        "Equipment classification and requirements, edition 3",
        locator="IEC 60825-1:2014",
        used="clauses 4.3, 5.3; tables 3 to 10, A.1, A.2, A.5, 400 to 1400 nm",
    ),
    "ANSI14": Source(
        title="Laser Institute of America, ANSI Z136.1-2014, American National Standard for Safe Use of Lasers, 2014",
        locator="ANSI Z136.1-2014",
        used="tables 5b to 5e, 6, 7, 8; hazard distance, 400 to 1400 nm",
    ),
    "ICNIRP13": Source(
        title="International Commission on Non-Ionizing Radiation Protection, Guidelines on limits of exposure to "
        "laser radiation of wavelengths between 180 nm and 1,000 um, Health Physics 105, 2013",
        locator="doi:10.1097/HP.0b013e3182983fd4",
        used="the limits that both standards print",
    ),
    "ISO05": Source(
        title="ISO 11146-1:2005, Lasers: test methods for laser beam widths, divergence angles and beam "
        "propagation ratios",
        locator="International Organization for Standardization, Geneva, 2005",
        used="the beam propagation ratio M^2",
    ),
    "COLLINS70": Source(
        title="S. A. Collins, Lens-system diffraction integral written in terms of matrix optics, 1970",
        locator="doi:10.1364/JOSA.60.001168",
        used="the diffraction integral of an ABCD system",
    ),
    "MACLEOD10": Source(
        title="H. A. Macleod, Thin-film optical filters, fourth edition, CRC Press, 2010",
        locator="ISBN 978-1-4200-7302-7",
        used="chapters 2 and 6: characteristic matrix, tilted admittances, quarter-wave stacks (`optics.coating`)",
    ),
    "JOHNSON72": Source(
        title="P. B. Johnson and R. W. Christy, Optical constants of the noble metals, Physical Review B 6, 1972",
        locator="doi:10.1103/PhysRevB.6.4370",
        used="table I: n, k of gold and silver, 0.617 to 1.088 um",
    ),
    "RAKIC95": Source(
        title="A. D. Rakić, Algorithm for the determination of intrinsic optical constants of metal films: "
        "application to aluminum, 1995",
        locator="doi:10.1364/AO.34.004755",
        used="n, k of aluminium, 0.620 to 1.033 um",
    ),
    "GAO12": Source(
        title="L. Gao, F. Lemarchand and M. Lequime, Exploitation of multiple incidences spectrometric "
        "measurements for thin film reverse engineering, 2012",
        locator="doi:10.1364/OE.20.015734",
        used="index of a Ta2O5 film, 0.6 to 1.1 um, fitted here",
    ),
    "DODGE84": Source(
        title="M. J. Dodge, Refractive properties of magnesium fluoride, Applied Optics 23, 1984",
        locator="doi:10.1364/AO.23.001980",
        used="dispersion of the ordinary ray",
    ),
    "BARNES92": Source(
        title="N. P. Barnes and L. B. Petway, Variation of the Verdet constant with temperature of terbium "
        "gallium garnet, 1992",
        locator="doi:10.1364/JOSAB.9.001912",
        used="rotation by wavelength and temperature",
    ),
    "SALEH07": Source(
        title="B. E. A. Saleh and M. C. Teich, Fundamentals of photonics, second edition, Wiley, 2007",
        locator="ISBN 978-0-471-35832-9",
        used="section 6.6: Jones matrices of a Faraday isolator",
    ),
    "BOR88": Source(
        title="Z. Bor, Distortion of femtosecond laser pulses in lenses and lens systems, 1988",
        locator="Journal of Modern Optics 35 (12), pages 1907-1918",
        used="delay between pulse and phase front behind a lens",
    ),
    "TPOINT11": Source(
        title="P. T. Wallace, TPOINT, a telescope pointing analysis system, version 18.20, 2011",
        locator="Tpoint Software, 10 December 2011",
        used="names and senses of the pointing terms; the text format of pointing data",
    ),
    "GBTPM01": Source(
        title="Green Bank Telescope, pointing series in use and its fit of 28-30 December 2001",
        locator="National Radio Astronomy Observatory, Green Bank, public pages; no report number is known here",
        used="the series, its coefficients and sky rms",
        errata=("does not print which way the corrections are added; AN and AW lean as named if encoders less sky",),
    ),
    "RUZE65": Source(
        title="J. Ruze, Lateral-feed displacement in a paraboloid, 1965",
        locator="IEEE Transactions on Antennas and Propagation 13 (5), pages 660-665",
        used="the beam deviation factor",
    ),
    "RUZE66": Source(
        title="J. Ruze, Antenna tolerance theory: a review, Proceedings of the IEEE 54, 1966",
        locator="doi:10.1109/PROC.1966.4784",
        used="the gain of a reflector with random errors",
    ),
    "BAARS07": Source(
        title="J. W. M. Baars, The Paraboloidal Reflector Antenna in Radio Astronomy and Communication, Springer, 2007",
        locator="doi:10.1007/978-0-387-69734-5",
        used="geometry of the paraboloid, path errors of a displaced surface",
    ),
    "NOLL76": Source(
        title="R. J. Noll, Zernike polynomials and atmospheric turbulence, 1976",
        locator="doi:10.1364/JOSA.66.000207",
        used="eqs. 1, 2 and table I: the polynomials, their numbers and their normalisation",
    ),
    "THIBOS02": Source(
        title="L. N. Thibos and others, Standards for reporting the optical aberrations of eyes, 2002",
        locator="doi:10.3928/1081-597X-20020901-30",
        used="the single number of a Zernike term as ANSI Z80.28 counts",
    ),
    "STEIN99": Source(
        title="M. L. Stein, Interpolation of Spatial Data: Some Theory for Kriging, Springer, 1999",
        locator="doi:10.1007/978-1-4612-1494-6",
        used="best linear unbiased prediction, Matern's covariances",
    ),
    "SCARGLE82": Source(
        title="J. D. Scargle, Studies in astronomical time series analysis II: unevenly spaced data, 1982",
        locator="doi:10.1086/160554",
        used="the power of a wave at uneven times",
    ),
    "BRINCKER01": Source(
        title="R. Brincker, L. Zhang and P. Andersen, Modal identification by frequency domain decomposition, 2001",
        locator="doi:10.1088/0964-1726/10/3/303",
        used="singular vectors of the spectral matrix are mode shapes",
    ),
    "BENDAT10": Source(
        title="J. S. Bendat and A. G. Piersol, Random Data, 4th edition, Wiley, 2010",
        locator="doi:10.1002/9781118032428",
        used="chapter 9: scatter of a ratio of amplitudes from the coherence",
    ),
}
