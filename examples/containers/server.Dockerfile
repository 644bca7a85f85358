# The environment of a policy server: the model's own image, and robospa without a simulator (six
# small packages). Name your model's image, which needs Python 3.10 or newer with pip:
#
#   docker build -f examples/containers/server.Dockerfile --build-arg MODEL=IMAGE:TAG -t policy .
#   docker run --rm --gpus all -p 127.0.0.1:8000:8000 -v "$PWD:/model:ro" policy \
#       serve my_policy:MyPolicy --host 0.0.0.0
#
# Without MODEL and without a command it serves `robospa serve random`, to try the wiring.
ARG MODEL=python:3.12-slim-trixie
FROM ${MODEL}

COPY . /opt/robospa
RUN python -m pip install --no-cache-dir /opt/robospa

# `module:factory` of `robospa serve` is looked for in the working folder, mounted from outside.
WORKDIR /model
ENV PYTHONPATH=/model
USER 1000:1000
EXPOSE 8000
ENTRYPOINT ["robospa"]
CMD ["serve", "random", "--host", "0.0.0.0"]
