# docker buildx build --platform linux/amd64,linux/arm64 --tag modt .
# docker run --rm --network host --volume "$PWD/runs:/runs" modt run velodyne:// --out /runs/live --core none
FROM python:3.12-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev
COPY . /src
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels /src

FROM python:3.12-slim
COPY systemd/requirements.txt /tmp/requirements.txt
RUN pip install --no-cache-dir --require-hashes --requirement /tmp/requirements.txt
COPY --from=build /wheels /tmp/wheels
RUN pip install --no-cache-dir --no-deps /tmp/wheels/*.whl && rm -r /tmp/wheels \
    && useradd --system modt && install --directory --owner modt /runs
USER modt
WORKDIR /runs
VOLUME /runs
ENTRYPOINT ["modt"]
CMD ["--help"]
