"""ONNX files in the format of Ultralytics' detectors. No trained network is in this repository."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

OPSET, IR_VERSION = 17, 8
SIDE_PX = 640
Shape = Sequence[int | str]


def save_model(
    path: Path,
    nodes: Sequence[onnx.NodeProto],
    constants: Mapping[str, NDArray[np.float32]],
    *,
    output: Shape,
    names: Mapping[int, str] | None,
    input_shape: Shape = (1, 3, SIDE_PX, SIDE_PX),
    **metadata: str,
) -> Path:
    """Write a network from `images` to `output0`, with the metadata of an export."""
    graph = helper.make_graph(
        list(nodes),
        "detector",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, list(input_shape))],
        [helper.make_tensor_value_info("output0", TensorProto.FLOAT, list(output))],
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    if names is not None:
        metadata["names"] = str(dict(names))
    helper.set_model_props(model, metadata)
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def constant_detector(path: Path, columns: Sequence[Sequence[float]], names: Mapping[int, str]) -> Path:
    """Write a network that answers every image with these columns: x, y, width, height, scores."""
    table = np.array(columns, np.float32).T[None]
    constants = {"table": table}
    return save_model(
        path,
        [helper.make_node("Identity", ["table"], ["output0"])],
        constants,
        output=table.shape,
        names=names,
    )


def colour_detector(path: Path, colours: Mapping[str, tuple[int, int, int]]) -> Path:
    """Write a network that finds an upright rectangle of each colour (red, green, blue).

    The box is that of all pixels of the colour. Its score is the share of its area that they fill: 1 for an
    upright rectangle, about 0.8 for a disc, little for two rectangles.
    """
    nodes: list[onnx.NodeProto] = []
    constants = {
        "near": np.array(0.15, np.float32),
        "half": np.array(0.5, np.float32),
        "side": np.array(SIDE_PX, np.float32),
        "least": np.array(200.0, np.float32),  # pixels
        "x": np.arange(SIDE_PX, dtype=np.float32).reshape(1, 1, 1, -1),
        "y": np.arange(SIDE_PX, dtype=np.float32).reshape(1, 1, -1, 1),
        "one": np.array(1.0, np.float32),
    }

    def add(operator: str, inputs: Sequence[str], output: str, **attributes: Any) -> str:
        nodes.append(helper.make_node(operator, list(inputs), [output], **attributes))
        return output

    for axis in "xy":
        add("Add", [axis, "one"], f"after_{axis}")
        add("Sub", ["side", axis], f"rest_{axis}")
    columns = []
    for number, colour in enumerate(colours.values()):
        constants[f"colour{number}"] = np.array(colour, np.float32).reshape(1, 3, 1, 1) / np.float32(255.0)
        constants[f"class{number}"] = np.eye(len(colours), dtype=np.float32)[number].reshape(1, -1, 1, 1)

        def name(what: str, number: int = number) -> str:
            return f"{what}{number}"

        add("Sub", ["images", name("colour")], name("off"))
        add("Abs", [name("off")], name("distances"))
        add("ReduceMax", [name("distances")], name("distance"), axes=[1], keepdims=1)
        add("Less", [name("distance"), "near"], name("is"))
        add("Cast", [name("is")], name("mask"), to=TensorProto.FLOAT)
        for axis in "xy":
            add("Mul", [name("mask"), f"after_{axis}"], name(f"ends_{axis}"))
            add("ReduceMax", [name(f"ends_{axis}")], name(f"end_{axis}"), keepdims=1)
            add("Mul", [name("mask"), f"rest_{axis}"], name(f"rests_{axis}"))
            add("ReduceMax", [name(f"rests_{axis}")], name(f"most_{axis}"), keepdims=1)
            add("Sub", ["side", name(f"most_{axis}")], name(f"start_{axis}"))
            add("Sub", [name(f"end_{axis}"), name(f"start_{axis}")], name(f"size_{axis}"))
            add("Add", [name(f"end_{axis}"), name(f"start_{axis}")], name(f"sum_{axis}"))
            add("Mul", [name(f"sum_{axis}"), "half"], name(f"centre_{axis}"))
        add("ReduceSum", [name("mask")], name("pixels"), keepdims=1)
        add("Mul", [name("size_x"), name("size_y")], name("area"))
        add("Div", [name("pixels"), name("area")], name("filled"))
        add("Greater", [name("pixels"), "least"], name("is_large"))
        add("Cast", [name("is_large")], name("large"), to=TensorProto.FLOAT)
        add("Mul", [name("filled"), name("large")], name("score"))
        add("Mul", [name("score"), name("class")], name("scores"))
        parts = [name(f"{what}_{axis}") for what in ("centre", "size") for axis in "xy"]
        columns.append(add("Concat", [*parts, name("scores")], name("column"), axis=1))
    add("Concat", columns, "table", axis=2)
    constants["shape"] = np.array([1, 4 + len(colours), len(colours)])
    add("Reshape", ["table", "shape"], "output0")
    return save_model(
        path,
        nodes,
        constants,
        output=(1, 4 + len(colours), len(colours)),
        names=dict(enumerate(colours)),
    )
