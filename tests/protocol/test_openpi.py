"""openpi's real client against our server."""

from typing import Any

import numpy as np
import pytest
from wire_helpers import Recall, observation

from robospa.observation import CameraSpec
from robospa.protocol.errors import DecodeError
from robospa.protocol.openpi import from_openpi
from robospa.protocol.policy import PolicySpec


def openpi_client(url: str, key: str | None = None) -> Any:
    module = pytest.importorskip("openpi_client.websocket_client_policy")
    return module.WebsocketClientPolicy(url, api_key=key)


def openpi_observation(**changes: Any) -> dict[str, Any]:
    image = np.moveaxis(observation()["images"]["head"], -1, 0)
    return {"images": {"cam_high": image}, "state": np.arange(14.0), "prompt": "pick it", **changes}


def test_the_real_openpi_client_is_served(start: Any) -> None:
    policy = Recall()
    client = openpi_client(start(policy).url)
    assert client.get_server_metadata()["robospa"]["spec"]["name"] == "test"
    client.reset()
    answers = [client.infer(openpi_observation())["actions"] for _ in range(3)]
    client.infer(openpi_observation(prompt="something else"))
    client._ws.close()
    assert [answer[0, 0] for answer in answers] == [0, 2, 4]
    assert [trial.instruction for trial in policy.trials] == ["pick it", "something else"]
    seen = policy.seen[0]
    assert np.array_equal(seen["images"]["head"], observation()["images"]["head"])
    assert seen["state"].dtype == np.float32
    assert [o["step"] for o in policy.seen] == [0, 2, 4, 0]


def test_a_failing_policy_sends_openpis_client_a_traceback(start: Any) -> None:
    policy = Recall()
    policy.fail_infer = 1
    server = start(policy)
    client = openpi_client(server.url)
    with pytest.raises(RuntimeError) as caught:
        client.infer(openpi_observation())
    assert "CUDA error: device lost" in str(caught.value).splitlines()[1]
    assert "Traceback" in str(caught.value)
    again = openpi_client(server.url)
    assert again.infer(openpi_observation())["actions"].shape == (2, 14)
    again._ws.close()


def test_an_image_of_another_size_is_refused_in_one_sentence(start: Any) -> None:
    client = openpi_client(start(Recall()).url)
    with pytest.raises(RuntimeError) as caught:
        client.infer(openpi_observation(images={"cam_high": np.zeros((3, 224, 224), np.uint8)}))
    first = str(caught.value).splitlines()[1]
    assert first.startswith("DecodeError: image cam_high is 224x224, but this policy reads 8x6: ")
    assert first.endswith("or serve the policy with CameraSpec('head', 224, 224)")
    assert "Traceback" not in str(caught.value)


def test_openpis_api_key_is_a_token(start: Any) -> None:
    client = openpi_client(start(Recall(), token="s3cret").url, "s3cret")
    assert client.infer(openpi_observation())["actions"].shape == (2, 14)
    client._ws.close()


SEES = PolicySpec("sees", cameras=(CameraSpec("head", 8, 6),), state="none")


@pytest.mark.parametrize(
    "image",
    [
        np.full((3, 6, 8), 51, np.uint8),
        np.full((6, 8, 3), 51, np.uint8),
        np.full((3, 6, 8), 0.2, np.float32),
    ],
)
def test_images_of_either_layout_and_range(image: Any) -> None:
    found = from_openpi({"images": {"cam_high": image}}, 0, SEES)["images"]["head"]
    assert found.shape == (6, 8, 3)
    assert found.dtype == np.uint8
    assert (found == 51).all()


@pytest.mark.parametrize(
    "value",
    [None, {"images": []}, {"images": {"cam_high": 1}}, {"state": [1.0]}, {"prompt": 3}, {}],
)
def test_what_is_no_openpi_observation(value: Any) -> None:
    with pytest.raises(DecodeError):
        from_openpi(value, 0, SEES)
