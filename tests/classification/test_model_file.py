"""Models of a stranger: they open no other file, and take no more memory than there is for them."""

from __future__ import annotations

from threading import Event

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from modt import model_file
from modt.classification import network as network_module
from modt.classification.onnx_check import find_flaw
from modt.errors import MisuseError
from modt.model_file import ModelFile
from tests.classification.scenes import classifier, saved
from tests.fuzz.execution import execute, limits
from tests.fuzz.runs import network

SECRET = "secret.bin"


def external(tensor):
    """The tensor, whose numbers are in another file."""
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    for key, value in (("location", SECRET), ("length", "48")):
        tensor.external_data.add(key=key, value=value)
    return tensor


def zeros(name, n=1, kind=np.float32):
    return numpy_helper.from_array(np.zeros(n, kind), name)


def initializer(tensor):
    return lambda model: model.graph.initializer.append(tensor)


def sparse(values, **options):
    made = onnx.SparseTensorProto(values=values, **options)
    return lambda model: model.graph.sparse_initializer.append(made)


def node(kind, **attributes):
    return lambda model: model.graph.node.append(helper.make_node(kind, ["points"], ["x"], **attributes))


TEXT = helper.make_tensor("t", TensorProto.STRING, [2], [b"a", b"b"])
EMPTY_TEXT = TensorProto(name="t", data_type=TensorProto.STRING, dims=[1 << 26])
LARGE_DIMS = [1 << 20, 1 << 12]
EMPTY = TensorProto(name="t", data_type=TensorProto.FLOAT, dims=LARGE_DIMS)
BRANCH = helper.make_graph([], "branch", [], [])
FUNCTION = helper.make_function("own", "f", ["a"], ["a"], [], [])


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        (initializer(TEXT), "text"),
        (initializer(EMPTY_TEXT), "text"),
        (initializer(EMPTY), "more numbers than the file holds"),
        (
            sparse(zeros("s"), indices=zeros("i", kind=np.int64), dims=LARGE_DIMS),
            "more numbers than the file holds",
        ),
        (node("ConstantOfShape", value=TEXT), "text"),
        (node("Constant", value_string="a"), "text"),
        (node("Constant", value_strings=["a", "b"]), "text"),
        (node("Cast", to=TensorProto.STRING), "text"),
        (lambda model: external(model.graph.initializer[0]), "another file"),
        (node("Constant", value=external(zeros("c", 12))), "another file"),
        (sparse(external(zeros("s"))), "another file"),
        (node("If", then_branch=BRANCH, else_branch=BRANCH), "a graph within a node"),
        (lambda model: model.functions.append(FUNCTION), "functions"),
    ],
)
def test_what_reaches_beyond_the_file_is_refused_before_it_runs(change, cause, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / SECRET).write_bytes(bytes(48))
    model = network()
    change(model)
    with pytest.raises(MisuseError, match=rf"not an ONNX model that is run here \(.*{cause}"):
        classifier(saved(tmp_path, model))


def test_an_attribute_of_another_name_may_have_the_number_of_the_type_of_text():
    for attributes in ({"axis": 8}, {"group": 8}, {"to": TensorProto.DOUBLE}, {"auto_pad": "SAME_UPPER"}):
        model = network()
        node("Cast", **attributes)(model)
        assert find_flaw(model.SerializeToString()) is None


def field(number, content):
    """A field of a message that holds bytes, as protocol buffers write it."""
    size = bytearray()
    length = len(content)
    while length >= 0x80:
        size.append(length & 0x7F | 0x80)
        length >>= 7
    return bytes([number << 3 | 2, *size, length]) + content


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize(("last", "flaw"), [(1, "a tensor of more numbers than the file holds"), (0, None)])
def test_a_million_bytes_of_dimensions_are_checked_in_no_time(packed, last, flaw):
    dims = [bytes([0xFF] * 8 + [0x7F])] * 140_000 + [bytes([last])]  # each but the last 2^63 - 1
    tensor = field(1, b"".join(dims)) if packed else b"".join(b"\x08" + dim for dim in dims)

    def check(content):
        assert find_flaw(content) == flaw

    with limits():
        assert execute(check, field(7, field(5, tensor)), ()) is None


def large(*nodes, **numbers):
    """A small file that makes a large tensor of what is pooled, and cuts it to the probabilities."""
    model = network()
    del model.graph.node[:], model.graph.initializer[:]
    pooled = helper.make_node("ReduceMax", ["points"], ["pooled"], axes=[1], keepdims=0)
    cut = helper.make_node("Slice", ["wide", "begin", "end", "axis"], ["probability"])
    model.graph.node.extend([pooled, *nodes, cut])
    numbers |= {"begin": [0], "end": [4], "axis": [1]}
    model.graph.initializer.extend(
        numpy_helper.from_array(np.array(value, np.int64), name) for name, value in numbers.items()
    )
    return model


LARGE = {
    "constants": large(
        helper.make_node("ConstantOfShape", ["shape"], ["weight"]),
        helper.make_node("MatMul", ["pooled", "weight"], ["wide"]),
        shape=[3, 1 << 28],
    ),
    "results": large(helper.make_node("Tile", ["pooled", "repeats"], ["wide"]), repeats=[1, 1 << 28]),
}


@pytest.mark.parametrize("model", LARGE.values(), ids=LARGE)
def test_a_small_file_that_takes_all_memory_is_refused(model, tmp_path):
    with limits(), pytest.raises(MisuseError, match="cannot run 8 proposals"):
        classifier(saved(tmp_path, model))


def test_an_output_of_another_shape_than_promised_is_refused(tmp_path):
    model = network()
    model.graph.node[-1].output[0] = "once"
    model.graph.node.append(helper.make_node("Tile", ["once", "repeats"], ["probability"]))
    model.graph.initializer.append(numpy_helper.from_array(np.array([2, 1], np.int64), "repeats"))
    with pytest.raises(MisuseError, match=r"an output of shape \(16, 4\)"):
        classifier(saved(tmp_path, model))


def test_outputs_that_are_no_probabilities_are_refused(tmp_path):
    model = network()
    model.graph.node[-1].output[0] = "product"
    model.graph.node.append(helper.make_node("Log", ["product"], ["logarithm"]))
    model.graph.node.append(helper.make_node("Mul", ["logarithm", "product"], ["probability"]))  # -inf times 0
    with pytest.raises(MisuseError, match="no probabilities"):
        classifier(saved(tmp_path, model))


def test_a_model_that_takes_for_ever_is_refused(tmp_path, monkeypatch):
    given = network_module.Network(ModelFile.read(saved(tmp_path, network())))
    end = Event()
    monkeypatch.setattr(given, "infer", lambda batch: end.wait(60.0))
    monkeypatch.setattr(network_module, "MOST_S", 0.0)
    with pytest.raises(MisuseError, match="longer than 0 s"):
        given.check_largest(8, 10)
    end.set()


def test_a_large_file_is_not_read_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(model_file, "MAX_BYTES", 100)
    with pytest.raises(MisuseError, match="larger than"):
        classifier(saved(tmp_path, network()))
