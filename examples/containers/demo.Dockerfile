# `robospa demo`, and any evaluation without a GPU: simulator, reports and Mesa's software driver.
#
#   docker build -f examples/containers/demo.Dockerfile -t robospa .
#   docker run --rm -v "$PWD/runs:/runs" robospa                                        # the demo
#   docker run --rm -v "$PWD/runs:/runs" --network host robospa eval ws://127.0.0.1:8000 --out mine
#
# Debian 13 has Mesa 25; Debian 12's is too old to render without a GPU.
FROM python:3.12-slim-trixie

RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        libvulkan1=1.* libx11-6=2:1.* mesa-vulkan-drivers=25.* \
    && rm -rf /var/lib/apt/lists/*

# The packages of the lock file: the numbers of the documentation were measured with them.
COPY . /opt/robospa
RUN pip install --no-cache-dir --require-hashes -r /opt/robospa/requirements.lock \
    && pip install --no-cache-dir --no-deps /opt/robospa \
    && useradd --create-home --uid 1000 robospa \
    && install -d -o robospa /runs

USER 1000:1000
WORKDIR /runs
ENTRYPOINT ["robospa"]
CMD ["demo", "--out", "/runs/demo"]
