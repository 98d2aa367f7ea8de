# Find a Python and keep an environment; sourced by the scripts here and by .ci/run, which set `root`.
# shellcheck shell=bash

export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 PIP_PROGRESS_BAR=off PIP_ROOT_USER_ACTION=ignore

# Print the first Python that is new enough and can make environments; $PYTHON, if set, is the only candidate.
find_python() {
    local candidate candidates=(python3 python3.13 python3.12 python3.11 python3.14 python)
    [ -z "${PYTHON:-}" ] || candidates=("$PYTHON")
    for candidate in "${candidates[@]}"; do
        if "$candidate" -c 'import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            command -v "$candidate"
            return
        fi
    done
    return 1
}

require_python() {
    find_python && return
    {
        echo "sma_bayes needs Python 3.11 or later with its venv module."
        echo "found: $("${PYTHON:-python3}" --version 2>&1 || true)"
        echo "what to do: install one (Debian, Ubuntu: apt-get install python3-venv), or name one: PYTHON=/path/to/python $0"
    } >&2
    return 2
}

# Checksum of files and folders of the checkout, by name and content.
checksum() {
    (cd "${root:?}" && find "$@" -type f ! -name '*.pyc' -exec cksum {} + | LC_ALL=C sort -k 3 | cksum)
}

# keep_environment FOLDER STAMP WHAT...: see that FOLDER holds what `pip install WHAT` gives.
# It is made anew if the Python or the place of the folder has changed, and installed into if STAMP has.
keep_environment() {
    local folder=$1 stamp="$2 ${*:3}" python made
    python=$(require_python) || return
    made="$("$python" -VV) $folder"
    if [ "$(cat "$folder/made-for" 2>/dev/null)" != "$made" ] || ! "$folder/bin/python" -c '' 2>/dev/null; then
        echo "making the environment $folder" >&2
        "$python" -m venv --clear "$folder" && echo "$made" >"$folder/made-for" || return
    fi
    if [ "$(cat "$folder/installed" 2>/dev/null)" != "$stamp" ]; then
        echo "installing sma_bayes into $folder" >&2
        "$folder/bin/python" -m pip install -qq "${@:3}" && echo "$stamp" >"$folder/installed"
    fi
}
