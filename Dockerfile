# A machine for the replication: `docker build -t replication .`, then `docker run --rm -it replication`.
# Its Python packages are those of environment.lock, which `make` installs by their hashes.
FROM python:3.12-slim AS tools
RUN apt-get update \
    && apt-get install --yes --no-install-recommends git make \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --create-home --shell /bin/bash replicator \
    && install --directory --owner replicator /replication
USER replicator
WORKDIR /replication

FROM tools
COPY --chown=replicator . .
RUN make .venv/.ready
ENV PATH=/replication/.venv/bin:$PATH
CMD ["bash"]
