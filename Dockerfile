# tussock with all its renderers: docker build -t tussock . && mkdir -m 777 -p out && docker run --rm -v "$PWD/out:/out" tussock run --world tiny --out /out/run
FROM python:3.11-slim-bookworm
# hadolint ignore=DL3008 (versions of Debian's packages are those of its release)
RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libosmesa6 libgl1-mesa-dri mesa-vulkan-drivers libvulkan1 \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /tussock
COPY . .
RUN pip install --no-cache-dir -c constraints.txt .
RUN useradd --create-home ant
USER ant
WORKDIR /home/ant
ENTRYPOINT ["tussock"]
