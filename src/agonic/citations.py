"""The bibliography: the published sources of every method, by key."""

from __future__ import annotations

from agonic.errors import AgonicError

CITATIONS: dict[str, str] = {
    "beaton-tukey-1974": (
        "A. E. Beaton, J. W. Tukey: The fitting of power series, meaning polynomials, illustrated "
        "on band-spectroscopic data. Technometrics 16(2), 147–185, 1974. "
        "doi:10.1080/00401706.1974.10489171"
    ),
    "bierman-1977": (
        "G. J. Bierman: Factorization Methods for Discrete Sequential Estimation. Academic Press, "
        "New York, 1977. ISBN 0-12-097350-2"
    ),
    "brunke-matzka-2018": (
        "H.-P. Brunke, J. Matzka: Numerical evaluation of magnetic absolute measurements with "
        "arbitrarily distributed DI-fluxgate theodolite orientations. Geoscientific "
        "Instrumentation, Methods and Data Systems 7, 1–6, 2018. doi:10.5194/gi-7-1-2018"
    ),
    "caruso-2000": (
        "M. J. Caruso: Applications of magnetic sensors for low cost compass systems. IEEE "
        "Position Location and Navigation Symposium, 177–184, 2000. "
        "doi:10.1109/PLANS.2000.838300"
    ),
    "foresee-hagan-1997": (
        "F. D. Foresee, M. T. Hagan: Gauss–Newton approximation to Bayesian learning. Proceedings "
        "of the International Conference on Neural Networks 1997, IEEE, 1930–1935. "
        "doi:10.1109/ICNN.1997.614194"
    ),
    "harbin-2018": (
        "Harbin Institute of Technology: 磁场方位测量方法 (Method of measuring the direction of a "
        "magnetic field), filed 18 July 2018. Patent CN 108871301 B"
    ),
    "hoeting-1999": (
        "J. A. Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky: Bayesian model averaging: a "
        "tutorial. Statistical Science 14(4), 382–417, 1999. doi:10.1214/ss/1009212519"
    ),
    "huber-1981": "P. J. Huber: Robust Statistics. Wiley, New York, 1981. doi:10.1002/0471725250",
    "iers-2010": (
        "G. Petit, B. Luzum (eds.): IERS Conventions (2010). IERS Technical Note 36, Verlag des "
        "Bundesamts für Kartographie und Geodäsie, Frankfurt am Main, 2010. ISBN 3-89888-989-6"
    ),
    "kok-2016": (
        "M. Kok, T. B. Schön: Magnetometer calibration using inertial sensors. IEEE Sensors "
        "Journal 16(14), 5679–5689, 2016. doi:10.1109/JSEN.2016.2569160"
    ),
    "kenward-roger-1997": (
        "M. G. Kenward, J. H. Roger: Small sample inference for fixed effects from restricted "
        "maximum likelihood. Biometrics 53(3), 983–997, 1997. doi:10.2307/2533558"
    ),
    "kukush-markovsky-vanhuffel-2004": (
        "A. Kukush, I. Markovsky, S. Van Huffel: Consistent estimation in an implicit quadratic "
        "measurement error model. Computational Statistics & Data Analysis 47(1), 123–147, 2004. "
        "doi:10.1016/j.csda.2003.10.022"
    ),
    "laidig-seel-2023": (
        "D. Laidig, T. Seel: VQF: Highly accurate IMU orientation estimation with bias estimation "
        "and magnetic disturbance rejection. Information Fusion 91, 187–204, 2023. "
        "doi:10.1016/j.inffus.2022.10.014"
    ),
    "li-griffiths-2004": (
        "Q. Li, J. G. Griffiths: Least squares ellipsoid specific fitting. Proceedings of "
        "Geometric Modeling and Processing 2004, IEEE, 335–340, 2004. "
        "doi:10.1109/GMAP.2004.1290055"
    ),
    "mackay-1992": (
        "D. J. C. MacKay: Bayesian interpolation. Neural Computation 4(3), 415–447, 1992. "
        "doi:10.1162/neco.1992.4.3.415"
    ),
    "markovsky-kukush-vanhuffel-2004": (
        "I. Markovsky, A. Kukush, S. Van Huffel: Consistent least squares fitting of ellipsoids. "
        "Numerische Mathematik 98(1), 177–194, 2004. doi:10.1007/s00211-004-0526-9"
    ),
    "nguyen-widrow-1990": (
        "D. Nguyen, B. Widrow: Improving the learning speed of 2-layer neural networks by choosing "
        "initial values of the adaptive weights. International Joint Conference on Neural Networks "
        "1990, IEEE, vol. 3, 21–26. doi:10.1109/IJCNN.1990.137819"
    ),
    "nga-2004": (
        "National Geospatial-Intelligence Agency: Handbook of Magnetic Compass Adjustment "
        "(formerly Pub. No. 226). Bethesda, MD, 2004; as first published by the Defense Mapping "
        "Agency, Washington, D.C., 1980."
    ),
    "nikolaev-2023": (
        "П. Н. Николаев, А. С. Эспиноза Валлес, М. С. Щербаков, Д. Д. Соболев: Гироскопия и "
        "навигация, том 31, № 3 (122), 2023. In English: P. N. Nikolaev, A. S. Espinoza V., "
        "M. S. Shcherbakov, D. D. Sobolev: Calibration of onboard magnetometers of the attitude "
        "control system of the SamSat-ION university nanosatellite. Gyroscopy and Navigation "
        "14(3), 259–266, 2023. doi:10.1134/S2075108723030069"
    ),
    "page-1954": (
        "E. S. Page: Continuous inspection schemes. Biometrika 41(1/2), 100–115, 1954. "
        "doi:10.1093/biomet/41.1-2.100"
    ),
    "patterson-thompson-1971": (
        "H. D. Patterson, R. Thompson: Recovery of inter-block information when block sizes are "
        "unequal. Biometrika 58(3), 545–554, 1971. doi:10.1093/biomet/58.3.545"
    ),
    "siegmund-1985": (
        "D. Siegmund: Sequential Analysis: Tests and Confidence Intervals. Springer, New York, "
        "1985. doi:10.1007/978-1-4757-1862-1"
    ),
    "wang-sheng-he-cheng-2020": (
        "Y. K. Wang, T. Sheng, L. He, Z. Y. Cheng: Calibration method of magnetometer based on BP "
        "neural network. Journal of Computer and Communications 8, 31–41, 2020. "
        "doi:10.4236/jcc.2020.86004"
    ),
    "zhou-hu-zhou-lange-2019": (
        "H. Zhou, L. Hu, J. Zhou, K. Lange: MM algorithms for variance components models. Journal "
        "of Computational and Graphical Statistics 28(2), 350–361, 2019. "
        "doi:10.1080/10618600.2018.1529601"
    ),
}
"""Full references by the key that `Provenance.method` holds."""


def find_citation(key: str) -> str:
    """The full reference of a method key.

    Raises `AgonicError` for a key that is not in the bibliography.

    >>> find_citation("huber-1981")
    'P. J. Huber: Robust Statistics. Wiley, New York, 1981. doi:10.1002/0471725250'
    """
    if key not in CITATIONS:
        raise AgonicError(f"no citation {key!r}; known keys are {', '.join(CITATIONS)}")
    return CITATIONS[key]
