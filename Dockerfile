# Everything of README in a container, as an ordinary user:
#   docker build -t traction . && docker run --rm -v "$PWD/out:/home/lab/out" traction
FROM python:3.13-slim-bookworm
RUN apt-get update \
    && apt-get install --yes --no-install-recommends git make \
    && rm -rf /var/lib/apt/lists/*
RUN useradd --create-home lab && mkdir /home/lab/out && chown lab /home/lab/out
USER lab
WORKDIR /home/lab/traction
COPY --chown=lab . .
RUN make .venv/.used
CMD ["sh", "-c", "make demo && cp -r demo/. ../out"]
