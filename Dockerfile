# alsph without what it is built with:
#
#     docker build --tag alsph .
#     docker run --rm --user "$(id -u):$(id -g)" --volume "$PWD:/work" alsph run cylinder --resolution 10 --until 20
#
# --build-arg EXTRAS='[tables,meshes]' takes the extras of pyproject.toml in.

FROM rust:1-slim-trixie AS build
# hadolint ignore=DL3008
RUN apt-get update && apt-get install --yes --no-install-recommends python3-venv && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /venv
WORKDIR /source
COPY . .
RUN /venv/bin/pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.13-slim-trixie
ARG EXTRAS=""
# hadolint ignore=DL3013,DL3042
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir "$(echo /wheels/alsph-*.whl)${EXTRAS}" \
    && useradd --uid 1000 --create-home alsph \
    && install --directory --owner=alsph /work
# The user may be any, with a home or without.
ENV MPLCONFIGDIR=/tmp/matplotlib
USER 1000
WORKDIR /work
ENTRYPOINT ["alsph"]
CMD ["--help"]
