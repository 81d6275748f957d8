#!/bin/sh
# SPDX-License-Identifier: MIT
# Install what make has built, or take it away again.
#
#     install/install.sh put BUILD VERSION PREFIX [DESTDIR]
#     install/install.sh remove PREFIX [DESTDIR]
#
# PREFIX/share/bergtow/installed lists every file and every folder that was made, and is what `remove` goes by: it takes
# away these files, and these folders where nothing else is in them. An older installation is removed first, so that
# none of its files stays behind.
set -e
what=$1
case $what in
put) build=$2 version=$3 prefix=$4 dest=${5:-} ;;
remove) prefix=$2 dest=${3:-} ;;
*) echo "usage: install.sh put BUILD VERSION PREFIX [DESTDIR] | remove PREFIX [DESTDIR]" >&2; exit 2 ;;
esac
case $prefix in
/*) ;;
*) echo "PREFIX=$prefix: begin it with /" >&2; exit 2 ;;
esac
list=$dest$prefix/share/bergtow/installed

take_away() {
    [ -f "$list" ] || return 0
    kept=$(mktemp)
    cp "$list" "$kept"
    while read -r kind path; do
        [ "$kind" = folder ] || rm -f "$dest$path"
    done <"$kept"
    rm -f "$list"
    # what Python has made of the package
    find "$dest$prefix/share/bergtow" -name __pycache__ -prune -exec rm -rf {} + 2>/dev/null || true
    # the deepest come last in the list
    sed -n 's/^folder //p' "$kept" | tac | while read -r path; do
        rmdir "$dest$path" 2>/dev/null || true
    done
    rm -f "$kept"
}

if [ "$what" = remove ]; then
    [ -f "$list" ] || { echo "$list: there is nothing of bergtow to remove" >&2; exit 1; }
    take_away
    exit 0
fi

take_away
made=$(mktemp)
trap 'rm -f "$made"' EXIT

# Make a folder and those above it; what was not there is noted.
folder() {
    [ -d "$dest$1" ] && return 0
    [ -z "$1" ] || folder "${1%/*}"
    mkdir "$dest$1"
    echo "folder $1" >>"$made"
}

# put_file MODE FILE PLACE
put_file() {
    folder "${3%/*}"
    install -m "$1" "$2" "$dest$3"
    echo "file $3" >>"$made"
}

put_link() {
    ln -sf "$1" "$dest$2"
    echo "file $2" >>"$made"
}

major=${version%%.*}
[ -z "$dest" ] || mkdir -p "$dest"
put_file 755 "$build/bergtow" "$prefix/bin/bergtow"
put_file 644 "$build/libbergtow.a" "$prefix/lib/libbergtow.a"
put_file 755 "$build/libbergtow.so.$version" "$prefix/lib/libbergtow.so.$version"
put_link "libbergtow.so.$version" "$prefix/lib/libbergtow.so.$major"
put_link "libbergtow.so.$major" "$prefix/lib/libbergtow.so"
for header in include/bergtow/*.h; do
    put_file 644 "$header" "$prefix/include/bergtow/${header##*/}"
done
pc=$(mktemp)
sed "s|@PREFIX@|$prefix|" "$build/share/bergtow.pc" >"$pc"
put_file 644 "$pc" "$prefix/lib/pkgconfig/bergtow.pc"
rm -f "$pc"
put_file 644 "$build/share/bergtow.1" "$prefix/share/man/man1/bergtow.1"
put_file 644 "$build/share/bergtow.bash" "$prefix/share/bash-completion/completions/bergtow"
put_file 644 "$build/share/_bergtow" "$prefix/share/zsh/site-functions/_bergtow"
find postproc -type f ! -name '*.pyc' ! -path '*/build/*' ! -path '*.egg-info/*' | sort >"$made.scripts"
while read -r script; do
    put_file 644 "$script" "$prefix/share/bergtow/$script"
done <"$made.scripts"
rm -f "$made.scripts"
folder "$prefix/share/bergtow"
echo "file $prefix/share/bergtow/installed" >>"$made"
install -m 644 "$made" "$list"
# not for a package, which has its own way
[ -n "$dest" ] || echo "import bergtow in Python: export PYTHONPATH=$prefix/share/bergtow/postproc (docs/install.md)"
