#!/usr/bin/perl
# SPDX-License-Identifier: BSD-3-Clause
# Point a Debian or Ubuntu at another package mirror, for any addresses in its sources:
#
#     perl package_mirror.pl CODENAME MIRROR FILE...      e.g. bookworm http://mirror.example/debian /etc/apt/sources.list
#
# Both forms of sources are read (one line each, and deb822 stanzas). Changed are those of the distribution's own suites, which are
# CODENAME, CODENAME-updates and so on with the component main; an address that ends in "-security" becomes MIRROR-security.
# Sources of other providers are not changed. Perl, because a minimal image has no Python yet. Exits with 1 and one line
# if no source was changed.
use strict;
use warnings;

sub refuse {
    print STDERR "$_[0]\n";
    exit 1;
}

my ($codename, $mirror, @files) = @ARGV;
refuse("usage: package_mirror.pl CODENAME MIRROR FILE...") unless @files;
$mirror =~ s{/+$}{};
my $changed = 0;

sub address {
    my ($old) = @_;
    return $old unless $old =~ m{^(https?|mirror\+\w+|ftp)://}i;
    $changed++;
    return $old =~ m{-security/*$} ? "$mirror-security" : $mirror;
}

# Whether suites and components of a source are the distribution's own.
sub ours { return $_[0] =~ /(^|\s)\Q$codename\E(-\S+)?(\s|$)/ && $_[1] =~ /(^|\s)main(\s|$)/ }

sub one_line {
    my ($line) = @_;
    my ($type, $uri, $gap, $suite, $components) =
        $line =~ /^(\s*deb(?:-src)?\s+(?:\[[^\]]*\]\s+)?)(\S+)(\s+)(\S+)(.*)$/ or return $line;
    return ours($suite, $components) ? $type . address($uri) . $gap . $suite . $components : $line;
}

sub stanza {
    my ($text) = @_;
    my ($suites) = $text =~ /^Suites:(.*(?:\n[ \t].*)*)/mi;
    my ($components) = $text =~ /^Components:(.*(?:\n[ \t].*)*)/mi;
    return $text unless defined $suites && defined $components && ours($suites, $components);
    $text =~ s{^(URIs:.*(?:\n[ \t].*)*)}{join('', map { address($_) } split(/(\s+)/, $1))}gmie;
    return $text;
}

for my $file (@files) {
    next unless -f $file;
    open(my $in, '<', $file) or refuse("$file: $!");
    my $text = do { local $/; <$in> } // '';
    close $in;
    if ($file =~ /\.sources$/) {
        $text = join("\n\n", map { stanza($_) } split(/\n(?:[ \t]*\n)+/, $text, -1));
    } else {
        $text = join("\n", map { one_line($_) } split(/\n/, $text, -1));
    }
    open(my $out, '>', $file) or refuse("$file: $!");
    print $out $text;
    close $out or refuse("$file: $!");
}
refuse("package_mirror.pl: no source of $codename main in: @files") unless $changed;
