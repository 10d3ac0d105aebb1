"""The familiarity models by name. Each is loaded when it is first used: one needs scikit-learn, which takes a second to import."""

from functools import wraps
from importlib import import_module
from typing import TYPE_CHECKING

from tussock.world.errors import InputError
from tussock.world.specs import Spec, parse_parameters, parse_spec, split_words

from .base import Model

if TYPE_CHECKING:
    from .adaboost import AdaBoost
    from .autoencoder import Autoencoder
    from .chain import Chain
    from .infomax import Infomax
    from .mlp import MLP
    from .mlp_mixture import MLPMixture
    from .mlp_rotation import MLPRotation
    from .mushroom_body import MushroomBody
    from .opponents import opponent
    from .perfect_memory import PerfectMemory
    from .random import RandomHeadings
    from .rbm import RBM
    from .visual_compass import VisualCompass

__all__ = [
    "MLP",
    "MODELS",
    "RBM",
    "AdaBoost",
    "Autoencoder",
    "Chain",
    "Infomax",
    "MLPMixture",
    "MLPRotation",
    "MushroomBody",
    "PerfectMemory",
    "RandomHeadings",
    "VisualCompass",
    "make_model",
    "opponent",
]

# A model is the class in the file of its name.
MODELS = {
    "random": "RandomHeadings",
    "visual-compass": "VisualCompass",
    "perfect-memory": "PerfectMemory",
    "chain": "Chain",
    "mlp": "MLP",
    "mlp-rotation": "MLPRotation",
    "mlp-mixture": "MLPMixture",
    "adaboost": "AdaBoost",
    "rbm": "RBM",
    "autoencoder": "Autoencoder",
    "infomax": "Infomax",
    "mushroom-body": "MushroomBody",
}
OPPONENT = "opponent-"  # before a model's name: the model twice, opposed
_HOME = {cls: name.replace("-", "_") for name, cls in MODELS.items()} | {"opponent": "opponents"}


def __getattr__(name: str):
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def model_class(name: str) -> type[Model]:
    """The class of a model's name. Raises InputError that lists the known ones."""
    if name not in MODELS:
        raise InputError(f"unknown model {name!r}; known: {', '.join(MODELS)}, or {OPPONENT} and one of these")
    return __getattr__(MODELS[name])


def make_model(name: str, **parameters) -> Model:
    """An untrained model by its name, which parameters may follow: "mushroom-body inputs=10 cells=20000".

    Parameters are its class's, and can be keywords as well; seed and device can only be these. Raises InputError for unknown names
    and parameters, and for values that mean nothing.
    """
    name, *words = split_words(text := name) or [""]
    try:
        cls = model_class(name.removeprefix(OPPONENT))
        spelled = parse_parameters(words, cls.name, cls)
        if twice := spelled.keys() & parameters.keys():
            raise InputError(f"{', '.join(sorted(twice))} is also given as a keyword; give it once")
        model = cls(**spelled, **parameters)
        model.check_parameters()
    except InputError as error:
        raise InputError(f"model {text!r}: {error}") if words else error from None
    if name.startswith(OPPONENT):
        from .opponents import opponent

        return opponent(model)
    return model


def model_spec(text: str) -> Spec:
    """The spec of a model's text."""

    def find(name: str):
        cls = model_class(name.removeprefix(OPPONENT))
        if not name.startswith(OPPONENT):
            return cls
        from .opponents import opponent

        @wraps(cls)
        def made(**parameters):
            return opponent(cls(**parameters))

        return made

    return parse_spec(text, find)
