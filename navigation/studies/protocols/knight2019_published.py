"""The errors that Knight et al. (2019) published: BrainsOnBoard/alife_outdoor_navigation_paper, scripts/benchmark_results/output.csv."""

# Root-mean-square errors (degrees) of routes 1 to 6, by memory and images.
_TABLE = {
    ("PerfectMemory", "mask"): (80.4404, 48.2086, 8.28641, 100.576, 84.7363, 97.1074),
    ("PerfectMemory", "skymask"): (80.9593, 68.2852, 7.89033, 101.947, 65.2098, 110.753),
    ("PerfectMemory", "horizon"): (80.3163, 52.9107, 9.83473, 98.9439, 83.3477, 93.644),
    ("PerfectMemory", "unwrapped"): (71.7977, 79.1224, 46.6832, 93.2053, 64.5078, 121.642),
    ("PerfectMemoryConstrained", "mask"): (59.7981, 42.7772, 8.28641, 41.051, 46.5098, 42.1237),
    ("PerfectMemoryConstrained", "skymask"): (61.1487, 47.6825, 7.89033, 39.2406, 47.597, 42.825),
    ("PerfectMemoryConstrained", "horizon"): (59.7907, 42.7395, 9.83473, 37.8595, 48.0646, 43.1514),
    ("PerfectMemoryConstrained", "unwrapped"): (55.867, 64.9869, 46.6832, 48.8993, 53.5088, 70.9873),
    ("InfoMax", "mask"): (60.8013, 75.6821, 15.0746, 82.2281, 62.6875, 28.807),
    ("InfoMax", "skymask"): (63.2323, 82.316, 13.3802, 62.9506, 64.9147, 39.0707),
    ("InfoMax", "horizon"): (60.7089, 59.5743, 14.9139, 65.495, 70.8598, 38.1128),
    ("InfoMax", "unwrapped"): (68.8662, 84.0632, 35.5671, 81.4522, 60.9775, 64.0486),
    ("InfoMaxConstrained", "mask"): (43.3837, 59.516, 15.0746, 55.9028, 50.9575, 24.0033),
    ("InfoMaxConstrained", "skymask"): (48.9692, 60.9899, 13.3802, 54.1445, 52.1361, 37.5752),
    ("InfoMaxConstrained", "horizon"): (45.3983, 57.3294, 14.9139, 57.1978, 55.0507, 36.0521),
    ("InfoMaxConstrained", "unwrapped"): (51.5857, 51.2583, 35.5671, 36.9629, 49.577, 47.2201),
}

# By route, memory and images.
PUBLISHED = {
    (f"route{number}", memory, images): value
    for (memory, images), values in _TABLE.items()
    for number, value in enumerate(values, start=1)
}
