# One image for the API and for Ray's nodes: Ray ships pickled work between them, so their code must be the same.
# Named by digest, so that the same commit gives the same image. `make pin-image` takes the newest, `make check-image`
# fails where there is none.
ARG PYTHON_IMAGE=python:3.11-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7
FROM ${PYTHON_IMAGE}

ENV PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    RAY_USAGE_STATS_ENABLED=0

# An exported FMU contains machine code, which a C compiler links.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends gcc libc6-dev \
    && rm -rf /var/lib/apt/lists/*

RUN useradd --uid 10001 --create-home --shell /usr/sbin/nologin wingfit \
    && install -d -o wingfit -g wingfit -m 0700 /data /run/ray-token \
    && install -d -o wingfit -g wingfit /opt/wingfit
WORKDIR /opt/wingfit

# Dependencies change less often than the code, so they have a layer of their own. The lock file also names the
# tools of development; as a list of constraints it gives versions only to what the service needs.
COPY pyproject.toml requirements.lock ./
RUN python -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['dependencies'], sep='\n')" \
        > /tmp/needed.txt \
    && pip install --constraint requirements.lock --requirement /tmp/needed.txt setuptools \
    && rm /tmp/needed.txt

COPY --chown=wingfit:wingfit LICENSE README.md ./
COPY --chown=wingfit:wingfit records records
COPY --chown=wingfit:wingfit importers importers
COPY --chown=wingfit:wingfit tracking tracking
COPY --chown=wingfit:wingfit cameras cameras
COPY --chown=wingfit:wingfit sim sim
COPY --chown=wingfit:wingfit checks checks
COPY --chown=wingfit:wingfit rigs rigs
COPY --chown=wingfit:wingfit inference inference
COPY --chown=wingfit:wingfit calibration calibration
COPY --chown=wingfit:wingfit diagnosis diagnosis
COPY --chown=wingfit:wingfit planning planning
COPY --chown=wingfit:wingfit report report
COPY --chown=wingfit:wingfit plot plot
COPY --chown=wingfit:wingfit export export
COPY --chown=wingfit:wingfit workers workers
COPY --chown=wingfit:wingfit service service
COPY --chown=wingfit:wingfit client client
COPY --chown=wingfit:wingfit cli cli
COPY --chown=wingfit:wingfit wingfit wingfit
RUN pip install --no-deps --no-build-isolation --editable .

USER wingfit
# Compiled kernels are kept beside the code. Where that cannot be written, they are copied to HOME at the first use; on
# another kind of processor they are compiled again, and kept there too.
RUN python -m compileall -q records tracking cameras sim checks calibration diagnosis planning report plot export workers service client cli \
    && python -m wingfit.sim.warm

# All that is written: /tmp and the data. The rest may be read-only.
ENV HOME=/tmp \
    WINGFIT_DATA=/data \
    WINGFIT_HOST=0.0.0.0 \
    WINGFIT_PORT=8321
EXPOSE 8321
HEALTHCHECK --interval=15s --timeout=5s --start-period=60s \
    CMD ["python", "-c", "import urllib.request as u; u.urlopen('http://127.0.0.1:8321/v1/health', timeout=4)"]
CMD ["wingfit", "serve"]
