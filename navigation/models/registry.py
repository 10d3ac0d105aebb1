"""The registry of familiarity models."""

from tussock.world.registry import Registry

OPPONENT = "opponent-"  # before the name of a model: opponent memories of it
HEMIFIELDS = "hemifields-"  # likewise: memories of both hemifields

MODELS = Registry(
    "models",
    "model",
    {
        name: f"tussock.navigation.models.{where}"
        for name, where in {
            "random": "random:RandomHeadings",
            "visual-compass": "visual_compass:VisualCompass",
            "perfect-memory": "perfect_memory:PerfectMemory",
            "chain": "chain:Chain",
            "window-memory": "window_memory:WindowMemory",
            "mlp": "mlp:MLP",
            "mlp-rotation": "mlp_rotation:MLPRotation",
            "mlp-mixture": "mlp_mixture:MLPMixture",
            "adaboost": "adaboost:AdaBoost",
            "rbm": "rbm:RBM",
            "autoencoder": "autoencoder:Autoencoder",
            "infomax": "infomax:Infomax",
            "mushroom-body": "mushroom_body:MushroomBody",
            "spiking-mushroom-body": "spiking_mushroom_body:SpikingMushroomBody",
            "spike-overlap": "spike_overlap:SpikeOverlap",
        }.items()
    },
)


def split_prefix(name: str) -> tuple[str, str]:
    """What stands before the name of a model (OPPONENT, HEMIFIELDS or nothing), and the name."""
    if name not in MODELS:
        for prefix in (OPPONENT, HEMIFIELDS):
            if name.startswith(prefix):
                return prefix, name.removeprefix(prefix)
    return "", name
