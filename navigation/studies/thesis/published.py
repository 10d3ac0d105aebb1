"""The numbers in the thesis (S. Athanasoulias, Autonomous Visual Navigation: a biologically inspired approach, Sussex)."""

FACTORS = tuple(range(1, 11))  # resize factors of appendix 7.3

# Appendix 7.3, degrees, resize factors 1 to 10.
RESIZED = {
    "mean_error_deg": (39.931, 40.190, 41.183, 41.411, 47.214, 46.092, 53.147, 58.858, 48.687, 53.034),
    "median_error_deg": (7.865, 7.989, 7.493, 10.036, 12.605, 13.018, 16.703, 24.060, 17.710, 25.247),
}
RESIZED_SMOOTHED = {
    "mean_error_deg": (40.775, 41.184, 40.725, 39.882, 41.678, 44.524, 49.823, 52.424, 47.901, 52.788),
    "median_error_deg": (7.690, 7.361, 7.174, 8.445, 10.468, 12.102, 13.539, 18.854, 18.467, 20.637),
}

# The grids that were searched for appendices 7.4 to 7.6; they follow from the numbers of the rows there (docs/report.md).
_ALL = {"activation": ("identity", "logistic", "tanh", "relu"), "solver": ("sgd", "adam", "lbfgs")}
GRIDS = {
    "first_20": _ALL
    | {"hidden_layer_sizes": ((20,), (20, 20)), "learning_rate_init": (1e-3, 1e-4, 1e-5), "tol": (1e-3, 1e-4, 1e-5)},
    "whole_route": _ALL
    | {
        "hidden_layer_sizes": ((20,), (20, 20), (100,)),
        "learning_rate_init": (1e-3, 1e-4, 1e-5, 1e-6),
        "tol": (1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
    },
    "more_in_corners": _ALL
    | {
        "activation": ("identity", "logistic", "relu", "tanh"),
        "hidden_layer_sizes": ((20,), (20, 20), (100,), (100, 100)),
        "learning_rate_init": (1e-3, 1e-4, 1e-5),
        "tol": (1e-3, 1e-4, 1e-5),
    },
}

# The first rows of appendices 7.4 to 7.6: mean validation score, mean training score, tuning.
BEST_TUNINGS = {
    "first_20": (
        0.850, 1.000,
        {"activation": "relu", "hidden_layer_sizes": (20, 20), "learning_rate_init": 1e-4, "solver": "lbfgs", "tol": 1e-5}
    ),
    "whole_route": (
        0.772, 0.875,
        {"activation": "relu", "hidden_layer_sizes": (100,), "learning_rate_init": 1e-6, "solver": "adam", "tol": 1e-6}
    ),
    "more_in_corners": (
        0.821, 1.000,
        {"activation": "tanh", "hidden_layer_sizes": (100,), "learning_rate_init": 1e-5, "solver": "lbfgs", "tol": 1e-4}
    )
}  # fmt: skip

GRID_VIEWS = 2601  # 4.1
HELD_OUT_ACCURACY = {"first_20": 1.00, "whole_route": 0.95}  # figures 24 and 26
CLASSIFIER_MEDIAN_DEG = {"first_20": 4.0, "whole_route": 45.0}  # 4.4.5 and 4.4.6
RECOVERED_IN_CORNERS = {"every 6th view": 3 / 9, "twice as many in corners": 7 / 9}  # figure 32
ITERATIONS_MEDIAN_DEG = {600: 110.0, 3000: 40.0}  # 4.4.7.1
SCAN_MEDIAN_DEG = {360: 40.0, 180: 15.0, 90: 10.0}  # 4.4.7.2
SCAN_180_IN_CONCLUSION_DEG = 17.0  # section 6 says 17 where 4.4.7.2 says 15
