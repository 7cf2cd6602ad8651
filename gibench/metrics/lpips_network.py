"""The networks of LPIPS from the `lpips` package, with their weights, beside any build of torch."""

from __future__ import annotations

import importlib
import sys
import threading
import types
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gibench.metrics.errors import MissingDependencyError, WeightsError
from gibench.metrics.lpips_weights import Net, load_backbone

if TYPE_CHECKING:
    import torch

_networks: dict[str, torch.nn.Module] = {}
_lock = threading.Lock()

META_REGISTRATIONS = "torchvision._meta_registrations"


def shared_network(net: Net) -> torch.nn.Module:
    """Give the process's one network of this kind, on the CPU, built at the first call; do not change it."""
    with _lock:
        if net not in _networks:
            _networks[net] = build_network(net)
        return _networks[net]


def build_network(net: Net) -> torch.nn.Module:
    """Build a network of one's own, for training or another device.

    Args:
        net: "alex" or "vgg".

    Returns:
        `lpips.LPIPS` on the CPU in evaluation mode, no parameter of which asks for a gradient. It takes two
        tensors (N, 3, H, W) in [−1, 1] and gives (N, 1, 1, 1).

    Raises:
        MissingDependencyError: when torch, torchvision or lpips is missing.
        WeightsError: when the weights cannot be had, or a tensor is missing or has another shape.
    """
    lpips = import_lpips()
    import torch

    # Built without memory, the network neither draws the random numbers nor allocates the 0.5 GB of
    # classifier that its definitions would; every tensor then has to come from the weights.
    with torch.device("meta"), warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="torchvision")
        network = lpips.LPIPS(net=net, pretrained=False, pnet_rand=True, verbose=False)
    network.scaling_layer = lpips.ScalingLayer()

    heads = torch.load(
        Path(lpips.__file__).parent / "weights" / "v0.1" / f"{net}.pth", map_location="cpu", weights_only=True
    )
    tensors = dict(network.scaling_layer.state_dict(prefix="scaling_layer."))
    for name, head in heads.items():
        tensors[name] = head
        # The package holds each head under two names.
        tensors[name.replace("lin", "lins.", 1)] = head
    layers = [name.removesuffix(".weight") for name in network.net.state_dict() if name.endswith(".weight")]
    convolutions = load_backbone(net)
    if len(layers) != len(convolutions):
        raise WeightsError(f"LPIPS {net} has {len(layers)} convolutions and its weights {len(convolutions)}")
    for layer, (kernel, bias) in zip(layers, convolutions, strict=True):
        tensors[f"net.{layer}.weight"] = torch.from_numpy(kernel)
        tensors[f"net.{layer}.bias"] = torch.from_numpy(bias)
    try:
        network.load_state_dict(tensors, strict=True, assign=True)
    except RuntimeError as error:
        raise WeightsError(f"the weights of LPIPS {net} do not fit its network: {error}") from error
    return network.eval().requires_grad_(False)


def import_lpips() -> Any:
    """Import `lpips`, and torchvision for it even where its compiled operators do not load.

    torchvision's wheels are compiled for the CUDA builds of torch. Beside a CPU build their library does not
    load, and the import ends in the module that describes the operators' shapes to the tracer. LPIPS needs no
    such operator, only the definitions of AlexNet and VGG, so that module is replaced by an empty one.

    Raises:
        MissingDependencyError: when a package is not installed, or torchvision fails in another way.
    """
    try:
        _import_torchvision()
        return importlib.import_module("lpips")
    except ImportError as error:
        raise MissingDependencyError(
            f"LPIPS needs torch, torchvision and lpips ({error}); run: pip install 'gibench[bench]'"
        ) from error


def _import_torchvision() -> None:
    try:
        importlib.import_module("torchvision")
        return
    except RuntimeError as error:
        if "torchvision::" not in str(error):
            raise MissingDependencyError(f"torchvision cannot be imported: {error}") from error
    for name in [name for name in sys.modules if name.split(".")[0] == "torchvision"]:
        del sys.modules[name]
    sys.modules[META_REGISTRATIONS] = types.ModuleType(META_REGISTRATIONS)
    importlib.import_module("torchvision")
