# The studio in a container:
#   docker build -t materialist .
#   docker run -p 7860:7860 -e MATERIALIST_PASSWORD=... -v "$PWD/scenes:/scenes" materialist
# The page asks for the password. To let in everybody who can reach the port, end the command with
#   materialist studio --host 0.0.0.0 --open
FROM python:3.12-slim

RUN apt-get update \
    && apt-get install -y --no-install-recommends libllvm19 libgomp1 libatomic1 \
    && rm -rf /var/lib/apt/lists/*

# The CPU build of torch: 1.7 GB in place of 5.3 GB with CUDA.
RUN pip install --no-cache-dir torch==2.13.0 --index-url https://download.pytorch.org/whl/cpu

WORKDIR /app
COPY pyproject.toml README.md LICENSE NOTICE ./
COPY src ./src
RUN pip install --no-cache-dir ".[app]"

RUN useradd --create-home --uid 1000 artist && mkdir /scenes && chown artist /scenes
USER artist
WORKDIR /scenes
EXPOSE 7860
CMD ["materialist", "studio", "--host", "0.0.0.0", "--port", "7860"]
