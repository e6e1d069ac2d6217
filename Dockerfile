# The lab in a container: `compose.yaml` runs it, docs/how-to/put-on-a-server.md says how.
#
# It listens on loopback and nowhere else. Alone it can be reached by nobody: a proxy has to share its network
# (`network_mode`), as in compose.yaml.

ARG PYTHON=3.11

FROM python:${PYTHON}-slim AS build
# What `make run` installs. Another extra is the Fetch's published meshes (CC BY-NC-SA 4.0) in place of the lab's own look:
# `--build-arg EXTRAS=[bullet,analysis,meshes]`. `EXTRAS=` serves on MuJoCo's physics and makes no reports.
ARG EXTRAS="[bullet,analysis]"
WORKDIR /src
COPY . .
# pybullet comes with 170 MB of other robots and a renderer, none of which is opened.
RUN python -m venv /opt/lab \
    && /opt/lab/bin/pip install --no-cache-dir --disable-pip-version-check ".${EXTRAS}" \
    && find /opt/lab -type d -name 'pybullet_[der]*' ! -name '*.dist-info' -prune -exec rm -rf {} + \
    && /opt/lab/bin/python -m compileall -q /opt/lab/lib/python3.*/site-packages/app \
        /opt/lab/lib/python3.*/site-packages/sim /opt/lab/lib/python3.*/site-packages/study

FROM python:${PYTHON}-slim
COPY --from=build /opt/lab /opt/lab
# Data, cache and home are one folder, the only one that the lab's user may write to, and that user's alone. A named
# volume takes that over when it is made.
RUN useradd --uid 10001 --no-create-home --home-dir /data --shell /usr/sbin/nologin lab \
    && install --directory --owner lab --group lab --mode 0700 /data
ENV PATH=/opt/lab/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1
USER 10001
WORKDIR /data
VOLUME /data
# Any answer will do: a lab that has too much to do, or cannot save, is not to be killed for it.
HEALTHCHECK --interval=30s --timeout=15s --start-period=120s --retries=3 \
    CMD ["python", "-c", "from http.client import HTTPConnection as C; c = C('127.0.0.1', 8000, timeout=10); c.request('GET', '/api/health/live'); c.getresponse()"]
ENTRYPOINT ["salab"]
CMD ["serve", "--data", "/data/lab", "--log-format", "json"]
