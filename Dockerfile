# interdrive without anything to install. `make wheel`, then `docker build -t interdrive .`, then
# `docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" interdrive run t_junction --out out/first`
# `make container` builds it and tries it; where there is no docker, it runs the same steps in an empty root.
FROM debian:bookworm-slim

RUN apt-get update && apt-get install --yes --no-install-recommends python3 python3-venv && rm -rf /var/lib/apt/lists/*
COPY dist/*.whl /opt/wheels/
RUN python3 -m venv /opt/interdrive
RUN /opt/interdrive/bin/pip install --no-cache-dir --find-links /opt/wheels interdrive

ENV PATH=/opt/interdrive/bin:/usr/local/bin:/usr/bin:/bin
ENV MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /work
ENTRYPOINT ["interdrive"]
